"""Packing: finished runs are moved from their directories into a study's tables."""

import shutil
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host import files
from evolution.run.directory import RunDirectory
from evolution.run.lock import LOCK, locked
from evolution.study.directory import PATIENCE, RUNNING, StudyDirectory
from evolution.study.finished_run import FinishedRun, read_finished
from evolution.study.histories import RunKey
from evolution.study.jobs import failure_log

SHARE = 20
"""The next packing comes after this many times what the last one took."""


@dataclass(frozen=True)
class Packing:
    """Outcome of a packing.

    Attributes:
        packed: number of runs that were moved into the tables.
        moved: number of unfinished runs of an older study that are in `running/` now.
        left: why finished runs are not in the tables, a line each.
        notes: what of packed runs is not in the tables, a line each.
    """

    packed: int
    moved: int
    left: tuple[str, ...]
    notes: tuple[str, ...]


def pack(study: StudyDirectory) -> Packing:
    """Move finished runs into the tables, and others of an older study to `running/`.

    The tables are written first. A kill in between leaves directories of runs that are
    in the tables, which the next packing removes.

    Raises:
        UserError: if a table or the study is damaged, or cannot be written, or another
            process is packing.
    """
    with locked(study.path, PATIENCE), files.writing():
        files.remove_leftovers(study.path)
        config, tables = study.stored_config(), study.tables
        known = tables.packed()
        found: dict[RunKey, FinishedRun] = {}
        ready: list[RunDirectory] = []
        others: list[tuple[RunKey, RunDirectory]] = []
        left: list[str] = []
        for name in config.experiments:
            for seed, directory in study.runs(name):
                run = name, seed
                if run in known or run in found:
                    ready.append(directory)
                elif not directory.finished:
                    others.append((run, directory))
                else:
                    try:
                        asked = config.with_seed(name, seed)
                        found[run] = read_finished(directory, name, asked)
                        ready.append(directory)
                    except UserError as error:
                        left.append(f"{name} seed {seed}: {error}")
        if found:
            tables.add(list(found.values()), list(config.experiments))
        for directory in ready:
            _remove(directory)
        moved = sum(_moved(directory, study.run(*run)) for run, directory in others)
        for name in config.experiments:
            _remove_empty(study.path / name)
    notes = tuple(run.note for run in found.values() if run.note)
    return Packing(len(found), moved, tuple(left), notes)


def _remove(directory: RunDirectory) -> None:
    """Remove the directory of a run that is in the tables, unless somebody is in it."""
    try:
        with directory.locked():
            for path in directory.path.iterdir():
                if path.name == LOCK:
                    continue
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path)
                else:
                    path.unlink()
    # the next packing removes it
    except (UserError, OSError):
        return
    shutil.rmtree(directory.path, ignore_errors=True)
    failure_log(directory.path).unlink(missing_ok=True)


def _moved(directory: RunDirectory, target: RunDirectory) -> bool:
    """Move an unfinished run to where a study goes on with it, if it is not there."""
    if directory.path == target.path or target.path.exists() or not directory.begun:
        return False
    # a process of an older version may still work there
    with directory.locked():
        pass
    target.path.parent.mkdir(parents=True, exist_ok=True)
    directory.path.rename(target.path)
    log = failure_log(directory.path)
    if files.is_file(log):
        log.rename(failure_log(target.path))
    return True


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


class Packer:
    """Packs the finished runs of a study that is at work."""

    def __init__(self, study: StudyDirectory):
        """Start without packing anything."""
        self._study = study
        self._last, self._cost = time.monotonic(), 0.0

    def now(self) -> None:
        """Pack.

        Raises:
            UserError: as `pack`.
        """
        started = time.monotonic()
        pack(self._study)
        self._last = time.monotonic()
        self._cost = self._last - started

    def when_due(self) -> None:
        """Pack if the last packing is long ago; try again later if it fails."""
        if time.monotonic() - self._last > SHARE * self._cost:
            with suppress(UserError):
                self.now()

    def finish(self) -> None:
        """Pack, and remove the folders of runs if they are empty.

        Raises:
            UserError: as `pack`.
        """
        self.now()
        running = self._study.path / RUNNING
        for name in self._study.stored_config().experiments:
            _remove_empty(running / name)
        _remove_empty(running)
