"""The study directory: its config, its tables, and the runs that are not in these."""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from epuck_mj.errors import UserError
from epuck_mj.host import files
from evolution.run.directory import RunDirectory
from evolution.run.lock import LOCK, locked
from evolution.study.config import (
    SEEDS_OF_STUDY_MAX,
    StudyConfig,
    seeds_from_yaml,
    seeds_to_yaml,
)

if TYPE_CHECKING:
    from evolution.study.tables import Tables

PREFIX = "seed-"

RUNNING = "running"
"""Folder of the runs that are not in the tables yet."""

PATIENCE = 10.0
"""How long to wait for another process that opens the same study [s]."""


class StudyDirectory:
    """Directory with `study.yaml`, the tables of finished runs, and `running/`.

    A run is in `running/<experiment>/seed-<n>/` until the tables have it. In older
    studies, all runs are in `<experiment>/seed-<n>/`.
    """

    def __init__(self, path: Path):
        """Name the directory, without touching it."""
        self.path = path
        self.config = path / "study.yaml"
        self.asked = path / "seeds.yaml"
        self.yardstick = path / "wall-follower.json"

    @property
    def tables(self) -> "Tables":
        """The tables of finished runs, which need not be there."""
        # pyarrow is slow to import
        from evolution.study.tables import Tables

        return Tables(self.path)

    def run(self, name: str, seed: int) -> RunDirectory:
        """The directory of one run until it is in the tables."""
        path = self.path / RUNNING / name / f"{PREFIX}{seed}"
        return RunDirectory(path, drawn=False)

    def runs(self, name: str) -> Iterator[tuple[int, RunDirectory]]:
        """Seeds and directories of the runs of an experiment that have one."""
        for place in (self.path / RUNNING / name, self.path / name):
            for seed in seeds_in(place):
                yield seed, RunDirectory(place / f"{PREFIX}{seed}", drawn=False)

    def seeds(self, name: str) -> list[int]:
        """Seeds with a directory or a row in the tables, in ascending order.

        Raises:
            UserError: if the tables are damaged.
        """
        packed = {seed for each, seed in self.tables.packed() if each == name}
        return sorted(packed | {seed for seed, _ in self.runs(name)})

    def asked_seeds(self) -> dict[str, list[int]]:
        """All seeds asked for so far, by experiment; empty for older studies.

        Raises:
            UserError: if the file that says so is damaged.
        """
        if not files.is_file(self.asked):
            return {}
        return seeds_from_yaml(self.asked)

    def open(self, config: StudyConfig, seeds: Collection[int]) -> None:
        """Make or reuse the directory, and add experiments and seeds.

        Raises:
            UserError: if it is something else, another study, or cannot be written.
        """
        if files.is_file(self.path):
            raise UserError(f"output '{self.path}' is not a directory")
        with files.writing():
            # in this order: another process may write the study meanwhile
            if self._holds_anything() and not files.is_file(self.config):
                raise UserError(
                    f"output '{self.path}' is not empty and holds no study: expected "
                    "a new directory, or one with a study.yaml"
                )
            # another process may be about to add experiments or seeds
            with locked(self.path, PATIENCE):
                files.remove_leftovers(self.path)
                asked = self.asked_seeds()
                if not asked and files.is_file(self.config):
                    # older studies did not store it
                    begun = self.stored_config().experiments
                    asked = {n: there for n in begun if (there := self.seeds(n))}
                for name in config.experiments:
                    asked[name] = sorted({*asked.get(name, ()), *seeds})
                    if len(asked[name]) > SEEDS_OF_STUDY_MAX:
                        raise UserError(
                            f"expected at most {SEEDS_OF_STUDY_MAX} seeds in "
                            f"'{self.path}', got {len(asked[name])} of {name}"
                        )
                if files.is_file(self.config):
                    config = self.stored_config().merged(config, self.path)
                files.write_text(self.config, config.to_yaml())
                files.write_text(self.asked, seeds_to_yaml(asked))

    def _holds_anything(self) -> bool:
        """Whether the directory holds more than leftovers of killed writers."""
        if not files.is_directory(self.path):
            return False
        return any(
            path.name != LOCK and not files.is_leftover(path)
            for path in self.path.iterdir()
        )

    def stored_config(self) -> StudyConfig:
        """The study that is there.

        Raises:
            UserError: if there is none, or it is damaged.
        """
        if not files.is_file(self.config):
            raise UserError(
                f"'{self.path}' is not a study: expected a file '{self.config}', as "
                "python -m evolution.study writes it"
            )
        return StudyConfig.from_yaml(self.config)


def seeds_in(place: Path) -> list[int]:
    """Seeds of the run directories in a folder, in ascending order."""
    found = (path.name for path in place.glob(f"{PREFIX}*/"))
    numbers = (part.removeprefix(PREFIX) for part in found)
    # not seed-01, a copy that a person made: it would count as seed 1 again
    return sorted(int(n) for n in numbers if n.isdecimal() and str(int(n)) == n)
