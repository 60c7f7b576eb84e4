"""Ships the studies in runs/: `python -m evolution.reproduce.publish`.

Copies the tables of finished runs, writes the reports and the verdicts on the
paper's claims, and puts the tables into the README and the pages of docs/.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse
from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.hybrids.__main__ import report_hybrids
from evolution.reproduce.__main__ import reproduce_paper
from evolution.study.config import seeds_to_yaml
from evolution.study.directory import StudyDirectory
from evolution.variations.__main__ import report_variations

REPORTED = ("paper", "wheels")
"""Studies that are reported: folders of runs/ and results/, and names of tables."""

TRANSFER, REAL_ROBOTS = "transfer", "real-robots"
"""Studies of evolution with real sensors and motors, which the gap measures."""

VARIATIONS = ("variations", "steps-150", "steps-500")
"""Studies of the paper's algorithms with one thing changed at a time."""

CLIMBING = "climbing"
"""The study of what evaluations on wheels are worth; it has a table."""

HYBRIDS, GOOD_ROBOT = "hybrids", "good-robot"
"""Studies of evolution that learns, and of the experiment `best`; they have a page."""

OTHERS = (TRANSFER, REAL_ROBOTS, HYBRIDS, GOOD_ROBOT, CLIMBING)
"""All that are not reported."""

GAPS = ("gap", "gap-calibrated")
"""Folders of the reality gap: in three kinds of worlds, and with calibrated gains."""

PAGES: Mapping[str, tuple[str, ...]] = {
    "README.md": ("medians",),
    "docs/champions.md": ("champions",),
    "docs/findings.md": ("paper", "wheels", CLIMBING),
    "docs/variations.md": ("variations",),
    "docs/transfer.md": (*GAPS, REAL_ROBOTS),
    "docs/hybrids.md": (HYBRIDS, GOOD_ROBOT),
}
"""Pages that show results, and the names of their tables."""


@dataclass(frozen=True)
class PublishOptions:
    """Copy the finished runs of runs/ to results/ and write all reports and tables.

    Run it in the repository's top folder. Without runs/, reports and tables are written
    again from results/.
    """


def publish(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    parse(
        PublishOptions, "python -m evolution.reproduce.publish", argv, PublishOptions()
    )
    for name in (*REPORTED, *OTHERS, *VARIATIONS):
        if (Path("runs") / name).is_dir():
            ship(Path("runs") / name, Path("results") / name)
    paper, *others = (str(path) for path in shipped(Path("results")))
    wheels = [argument for path in others for argument in ("--wheels", path)]
    reproduce_paper(["--study", paper, *wheels, "--output", "results"])
    hybrids = Path("results") / HYBRIDS
    if hybrids.is_dir():
        report_hybrids([str(hybrids), "--output", "results/report-hybrids"])
    if varied := _variations(Path("results")):
        studies = [str(path) for path in varied]
        report_variations([*studies, "--output", "results/report-variations"])
    # git keeps the pages that it shows, with their pictures
    for pattern in ("report-*/**/*", "gap*/*"):
        for file in Path("results").glob(pattern):
            if file.suffix in (".svg", ".pdf", ".html"):
                file.unlink()
    for page, text in pages_with_tables(Path()).items():
        files.write_text(page, text)
    return 0


def _variations(results: Path) -> list[Path]:
    """Paths of the shipped studies of variations."""
    return [results / name for name in VARIATIONS if (results / name).is_dir()]


def shipped(results: Path) -> list[Path]:
    """Paths of the shipped studies."""
    return [results / name for name in REPORTED if (results / name).is_dir()]


def ship(source: Path, target: Path) -> None:
    """Add the finished runs of a study, if any, to a copy of the study.

    Runs that the copy has already are replaced, and its other runs stay.
    """
    # pyarrow is slow to import
    from evolution.study.packing import pack

    study, copies = StudyDirectory(source), StudyDirectory(target)
    pack(study)
    config, asked = study.stored_config(), study.asked_seeds()
    if copies.config.is_file():
        config = copies.stored_config().merged(config, copies.path)
        for name, seeds in copies.asked_seeds().items():
            asked[name] = sorted({*seeds, *asked.get(name, ())})
    runs = list(study.tables.runs(config).values())
    if not runs:
        return
    target.mkdir(parents=True, exist_ok=True)
    copies.tables.add(runs, list(config.experiments), again=True)
    files.write_text(copies.config, config.to_yaml())
    files.write_text(copies.asked, seeds_to_yaml(asked))
    if study.yardstick.exists():
        files.write_text(copies.yardstick, files.read_text(study.yardstick))


def pages_with_tables(root: Path) -> dict[Path, str]:
    """Texts of the pages below `root`, with the tables of the shipped results.

    Raises:
        UserError: if a page lacks the marker of one of its tables.
    """
    tables = _tables(root / "results")
    pages = {}
    for name, shown in PAGES.items():
        path = root / name
        text = path.read_text(encoding="utf-8")
        for table in shown:
            if table in tables:
                text = _with_table(text, table, tables[table], path)
        pages[path] = text
    return pages


def _tables(results: Path) -> dict[str, str]:
    """Tables of the shipped studies, by name, in Markdown."""
    # slow to import
    from evolution.hybrids.hybrids_page import worth_table
    from evolution.pages.blocks import to_markdown
    from evolution.reproduce.champions_table import champions_table
    from evolution.reproduce.climbing_table import climbing_table
    from evolution.reproduce.real_robots_table import real_robots_table
    from evolution.reproduce.reproduction import medians_table, runs_table
    from evolution.study.data import load_study
    from evolution.variations.variations_page import orders_table
    from evolution.variations.varied import orders, varied_of

    tables, studies = {}, [load_study(path) for path in shipped(results)]
    for study in studies:
        name = study.path.name
        tables[name] = to_markdown([runs_table(study)])
        if name == REPORTED[0]:
            tables["medians"] = to_markdown([medians_table(study, WHEELED_ROBOT)])
    table_of = {
        REAL_ROBOTS: real_robots_table,
        HYBRIDS: worth_table,
        GOOD_ROBOT: worth_table,
        CLIMBING: climbing_table,
    }
    for name in OTHERS:
        if (results / name).is_dir():
            studies.append(load_study(results / name))
            if name in table_of:
                tables[name] = to_markdown([table_of[name](studies[-1])])
    tables["champions"] = to_markdown([champions_table(studies)])
    if varied := _variations(results):
        found = orders(varied_of([load_study(path) for path in varied]))
        tables["variations"] = to_markdown([orders_table(found)])
    for name in GAPS:
        gap = results / name / "summary.md"
        if gap.exists():
            tables[name] = gap.read_text(encoding="utf-8")
    return tables


def _with_table(text: str, name: str, table: str, path: Path) -> str:
    """The text of a page with one table replaced."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise UserError(f"expected '{begin.strip()}' and '{end}' in '{path}'")
    return before + begin + table + end + after


if __name__ == "__main__":
    main(publish)
