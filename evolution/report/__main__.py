"""What a study has found: `python -m evolution.report STUDY [--output report]`."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.host.command_line import main, parse, word

EXAMPLES = (
    "python -m evolution.report runs/paper --output report",
    "python -m evolution.report runs/paper --output report --ioh",
)


@dataclass(frozen=True)
class ReportOptions:
    """Report a study: tables, figures, and a page that shows them.

    Works for a study that is not finished and says what is missing. The same study
    gives the same bytes.

    Attributes:
        study: study directory.
        output: directory to write to; `report` in the study if not given.
        ioh: also export the histories for IOHanalyzer, to `ioh` in the output.
    """

    study: tyro.conf.Positional[Annotated[Path, word("STUDY")]]
    output: Annotated[Path | None, word("FOLDER")] = None
    ioh: bool = False


def report_study(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(
        ReportOptions, "python -m evolution.report", argv, examples=EXAMPLES
    )
    # slow to import
    from evolution.report.report_folder import write_report

    output = options.output or options.study / "report"
    for line in write_report(options.study, output, options.ioh):
        print(f"missing: {line}", file=sys.stderr)
    print(f"Report: {output / 'report.html'} and {output / 'report.md'}")
    return 0


if __name__ == "__main__":
    main(report_study)
