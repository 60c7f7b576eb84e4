"""Verify shipped runs: `python -m evolution.verify results/paper/...`.

MuJoCo gives the same bits only for one version on one type of processor. Where a run
differs, differing versions and processors are printed.
"""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import check_threads, main, parse, word
from epuck_mj.policies.file import CHAMPION, CHAMPIONS
from evolution.run.directory import RunDirectory
from evolution.run.provenance import blas, processor
from evolution.study.addresses import PlacedRun, runs_at
from evolution.verify.written import Written, read_run

if TYPE_CHECKING:
    from evolution.judging.held_out import Judges

MODULE = "evolution.verify"


EXAMPLES = (
    "python -m evolution.verify runs/ga-seed-1",
    "python -m evolution.verify results/paper results/wheels/ga/seed-1",
)


@dataclass(frozen=True)
class Options:
    """Make the results of finished runs again and compare them with what is written.

    Everything that a champion's file says is compared, and the histories. The exit
    status is 1 if anything differs.

    Attributes:
        paths: run directories, STUDY/EXPERIMENT/seed-N, or study directories to verify
            all their runs.
        threads: threads that step the robots; 0 is one per core. Changes no result.
    """

    paths: tyro.conf.Positional[Annotated[tuple[Path, ...], word("RUN")]]
    threads: int = 0


def verify(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    check_threads(options.threads)
    runs = [run for path in options.paths for run in _runs(path)]
    if not runs:
        raise UserError("expected run or study directories")
    # report damaged runs before an hour of work
    found: list[Written] = []
    for run in runs:
        try:
            found.append(read_run(run))
        except UserError as error:
            print(f"{run.path}: {error}", flush=True)
    same = 0
    if found:
        # simulators are slow to import: after the checks of the command line
        from evolution.judging.held_out import Judges

        judges = Judges(options.threads)
        same = sum(_verified(written, judges, options.threads) for written in found)
    print(f"{same} of {len(runs)} runs are the same to the last bit")
    return 0 if same == len(runs) else 1


def _runs(path: Path) -> list[PlacedRun]:
    """The finished runs at a path.

    Raises:
        UserError: if there are none.
    """
    found = [
        run
        for run in runs_at(path, histories=True)
        if not isinstance(run, RunDirectory) or run.has_results
    ]
    if not found:
        raise UserError(
            f"no champion in '{path}': expected the directory of a finished run, of a "
            "study with one, or STUDY/EXPERIMENT/seed-N"
        )
    return found


def _verified(written: Written, judges: "Judges", threads: int) -> bool:
    """Verify a run and print the outcome; whether everything is the same."""
    from evolution.verify.rewritten import compared

    path = written.run.path
    try:
        outcome = compared(written, judges, threads)
    except UserError as error:
        print(f"{path}: {error}", flush=True)
        return False
    lines, unsaid = outcome.differing, ", ".join(outcome.unsaid)
    file = CHAMPIONS if written.packed else CHAMPION
    silent = f"; {file} does not say {unsaid}" if unsaid else ""
    if not lines:
        print(f"{path}: the same to the last bit{silent}", flush=True)
        return True
    causes = "; ".join(changes(written.provenance))
    print(f"{path}: not the same{silent}", *lines, sep="\n  ")
    print(f"  since then: {causes or 'nothing that is recorded changed'}", flush=True)
    return False


def changes(provenance: Mapping[str, Any]) -> list[str]:
    """Versions and processor that differ from those of the run, a text each."""
    changes = []
    for package, before in provenance.get("versions", {}).items():
        now = _version(package)
        if now != before:
            changes.append(f"{package} {before} is now {now}")
    before, now = provenance.get("processor", {}), processor()
    if before.get("model") != now["model"]:
        changes.append(f"processor {before.get('model')} is now {now['model']}")
    flags, have = set(before.get("flags", ())), set(now["flags"])
    if flags - have:
        changes.append(f"CPU flags gone: {' '.join(sorted(flags - have))}")
    if have - flags:
        changes.append(f"CPU flags new: {' '.join(sorted(have - flags))}")
    return changes


def _version(package: str) -> str:
    if package == "python":
        return platform.python_version()
    if package == "blas":
        return blas()
    try:
        return version(package)
    except PackageNotFoundError:
        return "not there"


if __name__ == "__main__":
    main(verify)
