"""Ships the studies in runs/: `python -m evolution.reproduce.publish`.

Copies what of each finished run is small enough for git, reports it, holds the paper's
claims against it, and puts its table into the README.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse
from evolution.reproduce.__main__ import reproduce_paper
from evolution.run.directory import RunDirectory
from evolution.study.directory import StudyDirectory

REPORTED = ("paper", "wheels")
"""Folders of runs/ and results/, and what stands between the README's markers."""

TRANSFER = "transfer"
"""The study of robots that differ; the gap measures it."""

README_FILE = Path("README.md")


@dataclass(frozen=True)
class PublishOptions:
    """Ship the finished runs of the studies in runs/; to be called at the top.

    Without these folders, everything is made anew from what was shipped before.
    """


def publish(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    parse(
        PublishOptions, "python -m evolution.reproduce.publish", argv, PublishOptions()
    )
    for name in (*REPORTED, TRANSFER):
        if (Path("runs") / name).is_dir():
            ship(Path("runs") / name, Path("results") / name)
    paper, *others = (str(path) for path in shipped(Path("results")))
    wheels = [argument for path in others for argument in ("--wheels", path)]
    reproduce_paper(["--study", paper, *wheels, "--output", "results"])
    text = with_tables(README_FILE.read_text(encoding="utf-8"), Path("results"))
    files.write_text(README_FILE, text)
    return 0


def shipped(results: Path) -> list[Path]:
    """The studies that are there."""
    return [results / name for name in REPORTED if (results / name).is_dir()]


def ship(source: Path, target: Path) -> None:
    """Copy the study and its finished runs, if any, without what can be made anew."""
    study, copies = StudyDirectory(source), StudyDirectory(target)
    names = study.stored_config().experiments
    pairs: list[tuple[Path, Path]] = []
    for name in names:
        for seed in study.seeds(name):
            run, copy = study.run(name, seed), copies.run(name, seed)
            if run.finished:
                pairs += zip(_kept(run), _kept(copy), strict=True)
    if pairs:
        pairs.append((study.config, copies.config))
        pairs.append((study.asked, copies.asked))
        pairs.append((study.yardstick, copies.yardstick))
    for path, copy in pairs:
        if path.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)


def _kept(run: RunDirectory) -> list[Path]:
    return [
        run.config,
        run.history,
        run.best_individuals,
        run.champion,
        run.timing,
        run.provenance,
    ]


def with_tables(text: str, results: Path) -> str:
    """The README's text with every table as the shipped studies have it now.

    Raises:
        UserError: if a marker is missing.
    """
    # slow to import
    from evolution.pages.blocks import to_markdown
    from evolution.reproduce.reproduction import runs_table
    from evolution.study.data import load_study

    tables = {
        path.name: to_markdown([runs_table(load_study(path))])
        for path in shipped(results)
    }
    gap = results / "gap" / "summary.md"
    if gap.exists():
        tables["gap"] = gap.read_text(encoding="utf-8")
    for name, table in tables.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not (found and closed):
            raise UserError(f"expected '{begin.strip()}' and '{end}' in the README")
        text = before + begin + table + end + after
    return text


if __name__ == "__main__":
    main(publish)
