"""A page about evolution that learns: `evolution.hybrids STUDY --output FOLDER`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, word

EXAMPLES = (
    "python -m evolution.hybrids runs/hybrids --output report-hybrids",
    "python -m evolution.hybrids results/hybrids --output report-hybrids",
)

CAPTIONS = {
    "worth": "Every run (dots) and medians. Dotted: the median of DE/best.",
    "sweep": "Medians with quartiles, by the share of the trials that lessons cost.",
}


@dataclass(frozen=True)
class HybridsOptions:
    """Write a page and figures about evolution that learns.

    Attributes:
        study: directory of the study hybrids, or of one with its experiments.
        output: folder for hybrids.md, hybrids.html and the figures.
    """

    study: tyro.conf.Positional[Annotated[Path, word("STUDY")]]
    output: Annotated[Path, word("FOLDER")]


def report_hybrids(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(
        HybridsOptions, "python -m evolution.hybrids", argv, examples=EXAMPLES
    )
    # slow to import
    from evolution.hybrids.compared import BASE
    from evolution.hybrids.hybrids_figures import sweep_figure, worth_figure
    from evolution.hybrids.hybrids_page import hybrids_page
    from evolution.pages.blocks import with_contents
    from evolution.pages.figure_files import write_page, write_pictures
    from evolution.study.data import load_study

    data = load_study(options.study)
    if BASE not in data.with_runs:
        raise UserError(
            f"expected runs of '{BASE}' to compare others with, got "
            + ", ".join(data.with_runs)
        )
    figures = {"worth": worth_figure(data), "sweep": sweep_figure(data)}
    pictures = write_pictures(options.output, figures, CAPTIONS)
    blocks = with_contents(hybrids_page(data, pictures))
    path = write_page(options.output, "hybrids", "Evolution that learns", blocks)
    print(f"Hybrids: {path}")
    return 0


if __name__ == "__main__":
    main(report_hybrids)
