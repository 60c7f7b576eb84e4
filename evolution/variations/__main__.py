"""A page about variations of the paper's algorithms: `evolution.variations`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, word

EXAMPLES = (
    "python -m evolution.variations runs/variations --output report-variations",
    "python -m evolution.variations runs/variations runs/steps-150 --output report",
)

FIGURE = "variations"


@dataclass(frozen=True)
class VariationsOptions:
    """Write a page and a figure about variations of the paper's algorithms.

    An experiment belongs to the algorithm that its name begins with: ga-tournament-2
    is a variation of ga.

    Attributes:
        studies: study directories; variations are compared with the unchanged
            algorithm with trials of the same length.
        output: folder for variations.md, variations.html and the figure.
    """

    studies: tyro.conf.Positional[Annotated[tuple[Path, ...], word("STUDY")]]
    output: Annotated[Path, word("FOLDER")]


def report_variations(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(
        VariationsOptions, "python -m evolution.variations", argv, examples=EXAMPLES
    )
    if not options.studies:
        raise UserError("expected study directories")
    # slow to import
    from evolution.pages.blocks import with_contents
    from evolution.pages.figure_files import write_page, write_pictures
    from evolution.study.data import load_study
    from evolution.variations.variations_figure import variations_figure
    from evolution.variations.variations_page import variations_page
    from evolution.variations.varied import orders, varied_of

    varied = varied_of([load_study(path) for path in options.studies])
    if not varied:
        raise UserError(
            "expected experiments that are named after de-best, de-rand or ga, got none"
        )
    found = orders(varied)
    caption = (
        "Every variation: held-out fitness on wheels as a share of the most, medians "
        "with quartiles; dotted: unchanged. On the right, how likely the best of three "
        "runs each have the paper's order of best stored fitness; dotted: 5 %."
    )
    figures = {FIGURE: variations_figure(varied, found)}
    (picture,) = write_pictures(options.output, figures, {FIGURE: caption})
    blocks = with_contents(variations_page(varied, found, picture))
    path = write_page(options.output, "variations", "Variations", blocks)
    print(f"Variations: {path}")
    return 0


if __name__ == "__main__":
    main(report_variations)
