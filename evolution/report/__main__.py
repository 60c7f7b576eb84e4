"""What a study has found: `python -m evolution.report STUDY [--output report]`."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse
from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.pages.blocks import (
    FIGURES,
    Block,
    Heading,
    Picture,
    to_html,
    to_markdown,
)
from evolution.pages.files import csv_text, save
from evolution.report.contests import comparisons, successes, targets
from evolution.report.figures import figures
from evolution.report.findings import behaviour, held_out_fitness, luck, rungs
from evolution.report.frame import how_to_reproduce, what_was_run
from evolution.report.ioh import export
from evolution.report.pairs import PairRow, pair_rows
from evolution.report.successes import SuccessRow, success_rows
from evolution.report.summary import summary, summary_text
from evolution.report.tables import TargetRow, run_rows, target_rows
from evolution.study.data import StudyData, load_study

MODULE = "evolution.report"


@dataclass(frozen=True)
class Options:
    """Report a study: tables, figures, and a page that shows them.

    Works for a study that is not finished and says what is missing. The same study
    gives the same bytes.

    Attributes:
        study: study directory.
        output: directory to write to; `report` in the study if not given.
        ioh: also export the histories for IOHanalyzer, to `ioh` in the output.
    """

    study: tyro.conf.Positional[Path]
    output: Path | None = None
    ioh: bool = False


def report(argv: Sequence[str]) -> int:
    """Run the command line; its exit status.

    Raises:
        UserError: for anything the user can put right.
    """
    options = parse(Options, f"python -m {MODULE}", argv)
    data = load_study(options.study)
    output = options.output or options.study / "report"
    with files.writing():
        (output / FIGURES).mkdir(parents=True, exist_ok=True)
        pictures, lacking = draw(data, output)
        if not data.yardstick:
            where = "not tested in the setting of all"
            lacking.append(f"{YARDSTICK}: {where}, nothing can be held against it")
        data = replace(data, missing=(*data.missing, *lacking))
        for name, text in tables(data).items():
            files.write_text(output / name, text)
        found = summary(data, output.as_posix(), options.ioh)
        files.write_text(output / "summary.json", summary_text(found))
        blocks = document(data, pictures, output.as_posix(), options.ioh)
        files.write_text(output / "report.md", to_markdown(blocks))
        title = f"Report of {data.path.as_posix()}"
        files.write_text(output / "report.html", to_html(title, blocks))
        if options.ioh:
            export(data, output / "ioh")
    for line in data.missing:
        print(f"missing: {line}", file=sys.stderr)
    print(f"Report: {output / 'report.html'} and {output / 'report.md'}")
    return 0


def tables(data: StudyData) -> dict[str, str]:
    """Texts of the CSV files by name."""
    runs = run_rows(data)
    return {
        "runs.csv": csv_text(list(runs[0]), runs),
        "pairwise.csv": csv_text(_columns(PairRow), pair_rows(data)),
        "success.csv": csv_text(_columns(SuccessRow), success_rows(data)),
        "targets.csv": csv_text(_columns(TargetRow), target_rows(data)),
    }


def _columns(row: type) -> list[str]:
    return [field.name for field in fields(row)]


def draw(data: StudyData, output: Path) -> tuple[dict[str, Picture], list[str]]:
    """Write the figures; each by name, and why others could not be drawn.

    Raises:
        UserError: if one cannot be written.
    """
    folder = output / FIGURES
    found: dict[str, Picture] = {}
    drawn = figures(data)
    while True:
        try:
            name, figure, caption = next(drawn)
        except StopIteration:
            return found, []
        except UserError as error:
            # the arena of another machine; all else can be shown
            return found, [f"not all figures could be drawn: {error}"]
        save(figure, folder, name)
        found[name] = Picture(name, caption, (folder / f"{name}.svg").read_bytes())


SECTIONS: tuple[tuple[Callable[[StudyData], list[Block]], tuple[str, ...]], ...] = (
    (what_was_run, ()),
    (held_out_fitness, ("held-out",)),
    (comparisons, ()),
    (successes, ()),
    (rungs, ("rungs",)),
    (luck, ("stored-and-held-out",)),
    (behaviour, ("behaviour", "trajectories")),
    (targets, ("targets",)),
)
"""The sections in order, and the figures that belong there."""


def document(
    data: StudyData, pictures: Mapping[str, Picture], output: str, ioh: bool
) -> list[Block]:
    """The whole report, held-out fitness before stored."""
    left = dict(pictures)
    blocks: list[Block] = []
    for section, names in SECTIONS:
        blocks += section(data)
        blocks += [left.pop(name) for name in names if name in left]
    if left:
        blocks += [Heading("Fitness against evaluations"), *left.values()]
    return [*blocks, *how_to_reproduce(data, output, ioh)]


if __name__ == "__main__":
    main(report)
