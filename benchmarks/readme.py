"""Puts the shipped studies' tables into the README: `python -m benchmarks.readme`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from epuck_mj import files
from epuck_mj.command_line import main, parse
from epuck_mj.errors import UserError
from evolution.report.blocks import to_markdown
from evolution.report.reproduction import runs_table
from evolution.study_data import load_study

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
STUDIES = {"paper": ROOT / "results" / "paper", "wheels": ROOT / "results" / "wheels"}
"""What stands between the README's markers of that name."""


@dataclass(frozen=True)
class Options:
    """Write the README's tables anew from what is in results/."""


def readme(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    parse(Options, "python -m benchmarks.readme", argv, Options())
    files.write_text(README, with_tables(README.read_text(encoding="utf-8")))
    return 0


def with_tables(text: str) -> str:
    """The README with every table as the shipped studies have it now.

    Raises:
        UserError: if a marker is missing.
    """
    for name, path in STUDIES.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not (found and closed):
            raise UserError(f"expected '{begin.strip()}' and '{end}' in the README")
        table = to_markdown([runs_table(load_study(path))])
        text = before + begin + table + end + after
    return text


if __name__ == "__main__":
    main(readme)
