"""The whole study by one command: `python -m evolution.reproduce --quick | --full`.

Runs the study, reports it, and tests each of the paper's claims on it.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse, shell_command, word
from epuck_mj.step.fitness import FORMULAS
from evolution.report.__main__ import report_study
from evolution.study.__main__ import study

QUICK, FULL = ("quick", "1-3"), ("paper", "1-100")
"""Studies and their seeds."""


EXAMPLES = (
    "python -m evolution.reproduce --quick",
    "python -m evolution.reproduce --study runs/paper",
)


@dataclass(frozen=True)
class ReproduceOptions:
    """Repeat the paper's comparison and report which of its claims hold.

    Writes studies, reports and REPRODUCTION.md. Call it again to continue.

    Attributes:
        quick: run three seeds with a twentieth of the budget, about a minute on two
            cores. Shows only that everything works.
        full: run 100 seeds of the paper's algorithms and of all baselines, some hours
            on two idle cores.
        output: directory for everything that is written.
        study: run nothing and report this study directory instead.
        wheels: with --study, the study directory of the runs evolved on wheels.
    """

    quick: bool = False
    full: bool = False
    output: Annotated[Path, word("FOLDER")] = Path("runs/reproduction")
    study: Annotated[Path | None, word("STUDY")] = None
    wheels: Annotated[Path | None, word("STUDY")] = None


def reproduce_paper(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(
        ReproduceOptions, "python -m evolution.reproduce", argv, examples=EXAMPLES
    )
    if options.wheels is not None and options.study is None:
        raise UserError("expected --study with --wheels")
    if [options.quick, options.full, options.study is not None].count(True) != 1:
        raise UserError(
            "expected one of --quick (3 seeds, about a minute on two cores), --full "
            "(100 seeds, some hours on two idle cores) and --study (write the "
            "verdict on a study that is there)"
        )
    study_names = [each.name for each in (options.study, options.wheels) if each]
    if len(set(study_names)) < len(study_names):
        raise UserError(
            f"expected studies in folders of different names, got '{options.study}' "
            f"and '{options.wheels}'"
        )
    place, failed = options.study, 0
    if place is None:
        name, seeds = FULL if options.full else QUICK
        place = options.output / name
        failed = study([name, "--seeds", seeds, "--output", str(place)])
        # 1: some runs failed, the others can be reported
        if failed > 1:
            return failed
    # slow to import
    from evolution.reproduce.first_generation import first_generation
    from evolution.reproduce.reproduction import reproduction
    from evolution.study.data import load_study

    main_study = load_study(place)
    wheels = None if options.wheels is None else load_study(options.wheels)
    for each in filter(None, (place, options.wheels)):
        report_study(
            [str(each), "--output", str(options.output / f"report-{each.name}")]
        )
    config = next(iter(main_study.configs.values()))
    try:
        unevolved = [first_generation(config, name) for name in FORMULAS]
    except UserError as error:
        # the arena may be on another machine; everything else can be shown
        print(f"missing: the first generation: {error}", file=sys.stderr)
        unevolved = []
    text = reproduction(
        main_study, wheels, unevolved, shell_command("evolution.reproduce", *argv)
    )
    path = options.output / "REPRODUCTION.md"
    with files.writing():
        options.output.mkdir(parents=True, exist_ok=True)
        files.write_text(path, text)
    print(f"Written: {path}")
    return failed


if __name__ == "__main__":
    main(reproduce_paper)
