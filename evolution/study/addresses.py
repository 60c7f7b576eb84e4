"""Addresses of runs: a run's directory, a study, or a run in a study's tables.

`STUDY/EXPERIMENT/seed-N` names a run whether it has a directory of its own or a row.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Union

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, load_controller
from evolution.run.directory import RunDirectory
from evolution.study.directory import PREFIX, RUNNING, StudyDirectory

if TYPE_CHECKING:
    # pyarrow is slow to import
    from evolution.study.finished_run import FinishedRun

PlacedRun = Union[RunDirectory, "FinishedRun"]
"""A run in its directory, finished or not, or one in the tables of a study."""


def runs_at(place: Path, histories: bool = False) -> list[PlacedRun]:
    """The run at an address, or all runs of the study there, by name and seed.

    Args:
        place: a path, which need not exist.
        histories: whether those in tables are read with their histories.

    Raises:
        UserError: if the tables, or the rows that are asked for, are damaged.
    """
    if files.is_directory(place):
        run = RunDirectory(place)
        if run.begun or files.is_file(run.champion):
            return [run]
        return _of_study(StudyDirectory(place), histories)
    name, number = place.parent.name, place.name.removeprefix(PREFIX)
    study = StudyDirectory(place.parent.parent)
    # as a person would write it: not seed-01
    if not number.isdecimal() or place.name != f"{PREFIX}{int(number)}":
        return []
    if not _has_tables(study):
        return []
    found = study.tables.runs(study.stored_config(), histories, (name, int(number)))
    return list(found.values())


def champion_at(place: str | Path) -> ControllerFile:
    """The champion of the one run at an address.

    Args:
        place: `STUDY/EXPERIMENT/seed-N`, or the directory of a run.

    Raises:
        UserError: if there is no run, or more than one, or it has no champion.
    """
    run = run_at(Path(place))
    return load_controller(run.path) if isinstance(run, RunDirectory) else run.champion


def run_at(place: Path) -> PlacedRun:
    """The one run at an address.

    Raises:
        UserError: if there is none, or more than one.
    """
    found = runs_at(place)
    if len(found) != 1:
        raise UserError(
            "expected one run, the directory of a run or STUDY/EXPERIMENT/seed-N, got "
            f"{len(found)} at '{place}'"
        )
    return found[0]


def _of_study(study: StudyDirectory, histories: bool) -> list[PlacedRun]:
    found: dict[tuple[str, int], PlacedRun] = {}
    if _has_tables(study):
        found |= study.tables.runs(study.stored_config(), histories)
    # runs in flight, and the layout of older studies
    folders = [study.path, study.path / RUNNING]
    names = {each.name for folder in folders for each in _folders(folder)}
    for name in names:
        for seed, run in study.runs(name):
            found.setdefault((name, seed), run)
    return [found[run] for run in sorted(found)]


def _has_tables(study: StudyDirectory) -> bool:
    return files.is_file(study.tables.champions) and files.is_file(study.config)


def _folders(path: Path) -> list[Path]:
    if not files.is_directory(path):
        return []
    return [each for each in path.iterdir() if each.is_dir()]
