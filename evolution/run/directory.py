"""The run directory: the files of a run, from which it can be resumed."""

import csv
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from filelock import FileLock, Timeout

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import CHAMPION
from evolution.run.provenance import now, read_provenance, to_json
from evolution.settings.comparison import differing_keys
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import load_config

if TYPE_CHECKING:
    from evolution.run.generation_loop import Evolution

LOCK = ".lock"
"""File that is locked by the process that works in a directory."""


@contextmanager
def locked(directory: Path, patience: float = 0.0) -> Iterator[None]:
    """Lock a directory against other processes for the block.

    Args:
        directory: made if it is not there.
        patience: how long to wait for another process to leave [s].

    Raises:
        UserError: if another process stays, or the directory cannot be made.
    """
    with files.writing():
        directory.mkdir(parents=True, exist_ok=True)
    lock = FileLock(directory / LOCK, timeout=patience)
    try:
        lock.acquire()
    except Timeout:
        raise UserError(
            f"another process is working in '{directory}': wait for it, or stop it"
        ) from None
    except OSError as error:
        raise UserError(f"cannot write output '{directory}': {error.strerror}") from (
            None
        )
    try:
        yield
    finally:
        lock.release()


class RunDirectory:
    """Files of a run, which is resumed from its config and checkpoint."""

    def __init__(self, path: Path):
        """Name the directory, without touching it."""
        self.path = path
        self.config = path / "config.yaml"
        self.provenance = path / "provenance.json"
        self.checkpoint = path / "checkpoint.npz"
        self.history = path / "history.csv"
        self.best_individuals = path / "best_individuals.npz"
        self.timing = path / "timing.csv"
        self.champion = path / CHAMPION
        self.fitness_figure = path / "fitness.png"
        self.trajectory = path / "trajectory.npz"
        self.trajectory_figure = path / "trajectory.png"
        self.recording = path / "champion.rrd"

    def locked(self, patience: float = 0.0) -> AbstractContextManager[None]:
        """See `locked`."""
        return locked(self.path, patience)

    def refuse_if_used(self) -> None:
        """Refuse a directory that is not empty.

        Raises:
            UserError: if it is not empty, or not a directory.
        """
        try:
            used = self.path.is_dir() and bool(self._names())
        except OSError as error:
            raise UserError(
                f"cannot write output '{self.path}': {error.strerror}"
            ) from None
        if files.is_file(self.path):
            raise UserError(f"output '{self.path}' is not a directory")
        if used:
            raise UserError(
                f"output '{self.path}' is not empty: expected a new directory, or "
                f"--resume {self.path} to continue the run in it"
            )

    def create(self, config: ExperimentConfig, provenance: dict) -> None:
        """Make the directory and write config and provenance.

        Raises:
            UserError: if it cannot be written.
        """
        self.refuse_if_used()
        with files.writing():
            self.path.mkdir(parents=True, exist_ok=True)
            files.remove_leftovers(self.path)
            files.write_text(self.config, config.to_yaml())
            files.write_text(self.provenance, to_json(provenance))

    def stored_config(self) -> ExperimentConfig:
        """The config of the run in the directory.

        Raises:
            UserError: if there is none.
        """
        if not files.is_file(self.config):
            raise UserError(f"no run in '{self.path}': no '{self.config}'")
        return load_config(self.config)

    def refuse_other_config(self, config: ExperimentConfig) -> None:
        """Refuse to resume with a changed config.

        Raises:
            UserError: naming the keys that differ.
        """
        differing = differing_keys(self.stored_config(), config)
        if differing:
            raise UserError(
                f"cannot resume '{self.path}' with another config; these keys differ: "
                + ", ".join(differing)
            )

    def restore(self, evolution: "Evolution", provenance: dict) -> list[str]:
        """Restore the evolution from the checkpoint, if there is one.

        Returns:
            What differs from where the run began and may change its last bits.

        Raises:
            UserError: if the checkpoint cannot be read or belongs to something else,
                or robot, arena or a user's own part has been edited since.
        """
        first = self.provenance_fields() or provenance
        self._refuse_other_models(first, provenance)
        if self.checkpoint.exists():
            state = files.read_arrays(self.checkpoint)
            try:
                config = str(state.pop("config", ""))
                where = f"its config in '{self.checkpoint}'"
                if ExperimentConfig.from_yaml(config, where) != evolution.config:
                    raise ValueError("it was made with another config")
                evolution.restore(state)
            except ValueError as error:
                raise UserError(
                    f"'{self.checkpoint}' is not a checkpoint of this run: {error}"
                ) from None
        with files.writing():
            files.remove_leftovers(self.path)
            # the run may have been killed between its files
            self._write_derived(evolution, ())
            resumed = [*first.get("resumed", ()), provenance]
            files.write_text(self.provenance, to_json({**first, "resumed": resumed}))
        keys = ("versions", "git", "processor")
        return [key for key in keys if first.get(key) != provenance[key]]

    def _refuse_other_models(self, first: dict, now: dict) -> None:
        before, after = first.get("mjcf_sha256"), now["mjcf_sha256"]
        if before != after:
            raise UserError(
                f"cannot resume '{self.path}': its robot or arena has been edited "
                f"since (SHA-256 {before}, now {after})"
            )
        own = first.get("own_sha256", {})
        for name, after in now["own_sha256"].items():
            if own.get(name) != after:
                raise UserError(
                    f"cannot resume '{self.path}': '{name}' has been edited since "
                    f"(SHA-256 {own.get(name)}, now {after})"
                )

    def save(self, evolution: "Evolution", seconds: Sequence[float]) -> None:
        """Write the checkpoint, then the files derived from it.

        Args:
            evolution: to save.
            seconds: that each generation since the last save took.

        Raises:
            UserError: if the directory can no longer be written; what was there
                before is intact.
        """
        config = np.array(evolution.config.to_yaml())
        try:
            state = {"config": config, **evolution.state()}
            files.write_arrays(self.checkpoint, state)
            self._write_derived(evolution, seconds)
        except OSError as error:
            raise UserError(
                f"cannot write '{self.path}': {error.strerror}; what was there before "
                f"is intact: --resume {self.path}"
            ) from None

    def _write_derived(self, evolution: "Evolution", seconds: Sequence[float]) -> None:
        """Write the files that are derived from the checkpoint."""
        files.write_text(self.history, evolution.history())
        if evolution.records:
            best = {
                "genomes": np.array(evolution.best_genomes),
                "fitness": np.array([record.best for record in evolution.records]),
            }
            files.write_arrays(self.best_individuals, best)
            files.write_text(self.timing, self._timing(evolution, seconds))

    def _timing(self, evolution: "Evolution", seconds: Sequence[float]) -> str:
        """Text of timing.csv; seconds are empty where a kill lost them."""
        taken: dict[int, str] = {}
        if files.is_file(self.timing):
            text = self.timing.read_text(encoding="utf-8", errors="replace")
            for row in csv.DictReader(text.splitlines()):
                # a row that was cut off says nothing
                with suppress(KeyError, TypeError, ValueError):
                    taken[int(row["generation"])] = f"{float(row['seconds']):.3f}"
        first = len(evolution.records) - len(seconds)
        taken |= {first + i: f"{each:.3f}" for i, each in enumerate(seconds)}
        lines = [
            f"{record.generation},{taken.get(record.generation, '')},"
            f"{record.control_steps},{record.crash_rate:.4f}\n"
            for record in evolution.records
        ]
        return "".join(["generation,seconds,control_steps,crash_rate\n", *lines])

    def evaluations(self) -> int:
        """Individuals evaluated up to the checkpoint."""
        if not self.checkpoint.exists():
            return 0
        return int(files.read_arrays(self.checkpoint)["records"][-1, 1])

    @property
    def finished(self) -> bool:
        """Whether the run has written everything."""
        return bool(self.provenance_fields().get("finished"))

    def mark_finished(self) -> None:
        """Write the time at which the run was finished."""
        fields = self.provenance_fields() | {"finished": now()}
        with files.writing():
            files.write_text(self.provenance, to_json(fields))

    def contents(self) -> str:
        """Names of the files, separated by commas."""
        return ", ".join(self._names())

    def _names(self) -> list[str]:
        """Names of the files, without temporary files of killed writers."""
        aside = {*files.leftovers(self.path), self.path / LOCK}
        return sorted(p.name for p in self.path.iterdir() if p not in aside)

    def provenance_fields(self) -> dict:
        """Provenance of the run; empty if it was killed before writing it.

        Raises:
            UserError: if it is damaged.
        """
        if not files.is_file(self.provenance):
            return {}
        return read_provenance(self.provenance)
