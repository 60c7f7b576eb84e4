"""The run directory: the files of a run, from which it can be resumed."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import CHAMPION
from evolution.judging.scores import read_champion
from evolution.run.history import read_history, timing_text
from evolution.run.lock import LOCK, locked
from evolution.run.provenance import now, read_provenance, to_json
from evolution.settings.comparison import differing_keys
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import load_config

if TYPE_CHECKING:
    from evolution.run.generation_loop import Evolution


class RunDirectory:
    """Files of a run, which is resumed from its config and checkpoint."""

    def __init__(self, path: Path, drawn: bool = True):
        """Name the directory, without touching it.

        Args:
            path: of the directory.
            drawn: whether pictures and a recording of the champion belong to the run;
                runs of a study go without.
        """
        self.path = path
        self.drawn = drawn
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
        """The config of the run in the directory; of its checkpoint if that is lost.

        Raises:
            UserError: if there is none.
        """
        if files.is_file(self.config):
            return load_config(self.config)
        if files.is_file(self.checkpoint):
            return self.checkpoint_config(files.read_arrays(self.checkpoint))
        raise UserError(f"no run in '{self.path}': no '{self.config}'")

    def checkpoint_config(self, state: Mapping[str, np.ndarray]) -> ExperimentConfig:
        """The config in the arrays of the checkpoint.

        Raises:
            UserError: if there is none.
        """
        where = f"its config in '{self.checkpoint}'"
        return ExperimentConfig.from_yaml(str(state.get("config", "")), where)

    @property
    def has_results(self) -> bool:
        """Whether the run has come to an end, though some of it may be lost."""
        try:
            return files.is_file(self.champion) or self.marked_finished()
        except UserError:
            return True

    @property
    def begun(self) -> bool:
        """Whether there is a run that can be continued."""
        return files.is_file(self.config) or files.is_file(self.checkpoint)

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
        if files.is_file(self.checkpoint):
            self.restore_checkpoint(evolution)
        elif files.is_file(self.champion) or files.is_file(self.history):
            raise UserError(
                f"cannot resume '{self.path}': '{self.checkpoint.name}' is missing, so "
                "the run would begin again and overwrite its files: remove the "
                "directory, or choose another one"
            )
        with files.writing():
            files.remove_leftovers(self.path)
            if not files.is_file(self.config):
                files.write_text(self.config, evolution.config.to_yaml())
            # the run may have been killed after some of its files were written
            self._write_derived(evolution, ())
            resumed = [*first.get("resumed", ()), provenance]
            files.write_text(self.provenance, to_json({**first, "resumed": resumed}))
        keys = ("versions", "git", "processor")
        return [key for key in keys if first.get(key) != provenance[key]]

    def restore_checkpoint(self, evolution: "Evolution") -> None:
        """Restore the evolution from the checkpoint.

        Raises:
            UserError: if it cannot be read or belongs to something else.
        """
        state = files.read_arrays(self.checkpoint)
        try:
            if self.checkpoint_config(state) != evolution.config:
                raise ValueError("it was made with another config")
            evolution.restore(state)
        except ValueError as error:
            raise UserError(
                f"'{self.checkpoint}' is not a checkpoint of this run: {error}"
            ) from None

    def _refuse_other_models(self, first: dict, now: dict) -> None:
        before, after = first.get("mjcf_sha256") or {}, now["mjcf_sha256"]
        names = sorted(n for n in before | after if before.get(n) != after.get(n))
        if names:
            raise UserError(
                f"cannot resume '{self.path}': its robot or arena has been edited "
                f"since: {', '.join(names)} (see mjcf_sha256 in '{self.provenance}')"
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
            timing = timing_text(evolution.records, seconds, self.timing)
            files.write_text(self.timing, timing)

    def evaluations(self) -> int:
        """Individuals evaluated up to the checkpoint."""
        if not self.checkpoint.exists():
            return 0
        return int(files.read_arrays(self.checkpoint)["records"][-1, 1])

    @property
    def kept(self) -> tuple[Path, ...]:
        """Files of a finished run that cannot be made anew without its checkpoint."""
        return (
            self.config,
            self.history,
            self.best_individuals,
            self.champion,
            self.timing,
            self.provenance,
        )

    @property
    def pictures(self) -> tuple[Path, ...]:
        """Files that show the champion of a finished run."""
        if not self.drawn:
            return ()
        return (
            self.fitness_figure,
            self.trajectory,
            self.trajectory_figure,
            self.recording,
        )

    @property
    def finished(self) -> bool:
        """Whether the run has written everything, and it is all there."""
        try:
            return self.marked_finished() and not self.lost()
        except UserError:
            return False

    def marked_finished(self) -> bool:
        """Whether the run has written everything; some of it may be lost.

        Raises:
            UserError: as `provenance_fields`.
        """
        return bool(self.provenance_fields().get("finished"))

    def lost(self) -> list[str]:
        """What of a finished run is missing or damaged, a text for each file.

        Pictures are missed only where they can be drawn again: copies of a run go
        without them and without the checkpoint.
        """
        asked = self.kept
        if files.is_file(self.checkpoint):
            asked += self.pictures
        lost = {
            path.name: f"{path.name} is missing"
            for path in asked
            # after a power cut, some disks leave an empty file
            if not files.is_file(path) or not path.stat().st_size
        }
        for path, read in (
            (self.history, read_history),
            (self.best_individuals, files.read_arrays),
            (self.champion, read_champion),
        ):
            try:
                if path.name not in lost:
                    read(path)
            except UserError as error:
                lost[path.name] = str(error)
        return list(lost.values())

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
