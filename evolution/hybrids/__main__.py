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
    """Run the command line; its exit status."""
    options = parse(
        HybridsOptions, "python -m evolution.hybrids", argv, examples=EXAMPLES
    )
    # slow to import
    from epuck_mj.host import files
    from evolution.hybrids.compared import BASE
    from evolution.hybrids.hybrids_figures import sweep_figure, worth_figure
    from evolution.hybrids.hybrids_page import hybrids_page
    from evolution.pages.blocks import (
        FIGURES_FOLDER,
        Picture,
        to_html,
        to_markdown,
        with_contents,
    )
    from evolution.pages.figure_files import write_figure
    from evolution.study.data import load_study

    data = load_study(options.study)
    if BASE not in data.with_runs:
        raise UserError(
            f"expected runs of '{BASE}' to hold others against, got "
            + ", ".join(data.with_runs)
        )
    folder = options.output / FIGURES_FOLDER
    with files.writing():
        folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    for name, figure in (("worth", worth_figure(data)), ("sweep", sweep_figure(data))):
        write_figure(figure, folder, name)
        svg = (folder / f"{name}.svg").read_bytes()
        pictures.append(Picture(name, CAPTIONS[name], svg))
    blocks = with_contents(hybrids_page(data, pictures))
    with files.writing():
        files.write_text(options.output / "hybrids.md", to_markdown(blocks))
        page = to_html("Evolution that learns", blocks)
        files.write_text(options.output / "hybrids.html", page)
    print(f"Hybrids: {options.output / 'hybrids.md'}")
    return 0


if __name__ == "__main__":
    main(report_hybrids)
