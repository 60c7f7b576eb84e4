"""Execution of a run: evolve, save on the way, choose and test the champion.

Single runs and runs of a study use the same code. The same config gives the same bytes,
with any threads and engine, and after any number of interruptions.
"""

import time
from collections.abc import Iterator, Sequence

from epuck_mj.host.files import writing
from epuck_mj.host.own_parts import is_own
from epuck_mj.scene.model_files import is_kinematic
from evolution.judging.held_out import Judges
from evolution.judging.scores import Scores
from evolution.run.directory import RunDirectory
from evolution.run.generation_loop import Evolution, Place
from evolution.run.history import Record
from evolution.run.means import Means
from evolution.run.provenance import provenance
from evolution.run.results import Stage, silent, write_results
from evolution.settings.config import ExperimentConfig
from evolution.settings.setting import Setting

SAVING_SHARE = 0.05
"""Largest share of time for checkpoints, where generations are short."""


def _notes(config: ExperimentConfig, judges: Judges) -> Iterator[str]:
    """Lines that somebody who waits for a run should know."""
    yield from judges.refusals(config.robot, config.setting)
    own = [name for name in (config.fitness, config.network) if is_own(name)]
    if own and is_kinematic(config.robot):
        yield (
            f"{' and '.join(own)}: not compiled, so trials on {config.robot} run "
            "step by step, which is slower"
        )


PLACES_KEPT = 4
"""Number of places that a process keeps."""


class Loaded:
    """Models, free space and judges, which runs of one process share."""

    def __init__(self, threads: int):
        """Start with nothing; `threads` step the judges' robots, 0 is one per core."""
        self._threads = threads
        self.judges = Judges(threads)
        self._places: dict[tuple[str, bool, float, Setting], Place] = {}

    def place(self, config: ExperimentConfig) -> Place:
        """Where the robots of a run drive.

        Raises:
            UserError: if robot or arena cannot be used.
        """
        robot, setting = config.robot, config.setting
        key = robot, config.climbs, config.body_margin, setting
        if key not in self._places:
            if len(self._places) == PLACES_KEPT:
                self._places, self.judges = {}, Judges(self._threads)
            place = self._places[key] = Place.of(config)
            self.judges.add(robot, setting, place.scene, place.space)
        return self._places[key]


class Run:
    """A run and its directory."""

    def __init__(
        self,
        config: ExperimentConfig,
        directory: RunDirectory,
        means: Means,
        argv: Sequence[str],
        loaded: "Loaded | None" = None,
    ):
        """Load everything that the run needs, without writing anything.

        Args:
            config: what to do.
            directory: where to write.
            means: how to do it.
            argv: what was asked for, for the provenance.
            loaded: what runs before this one have loaded.

        Raises:
            UserError: if robot or arena cannot be used, or the budget is too small.
        """
        loaded = loaded or Loaded(means.threads)
        self.evolution = Evolution(
            config, means.engine, means.threads, means.racing, loaded.place
        )
        self.directory = directory
        # checked now, not after evolution
        scene = self.evolution.scene
        self._judges = loaded.judges.tested_on(config.robot, config.setting)
        self.notes = tuple(_notes(config, loaded.judges))
        """What somebody who waits for the run should know, a line each."""
        self._provenance = provenance(
            scene, config.own_parts, argv, str(means.engine), means.threads
        )
        self._threads = means.threads

    def start(self) -> None:
        """Begin in a new directory.

        Raises:
            UserError: if it holds anything, or cannot be written.
        """
        self.directory.create(self.evolution.config, self._provenance)

    def resume(self) -> list[str]:
        """Continue from the checkpoint in the directory.

        Returns:
            What differs from where the run began and may change its last bits.

        Raises:
            UserError: as `RunDirectory.restore`.
        """
        return self.directory.restore(self.evolution, self._provenance)

    def evolve(self) -> Iterator[Record]:
        """Run the remaining generations, saving on the way."""
        before, cost = time.monotonic(), 0.0
        seconds: list[float] = []
        for record in self.evolution.run():
            after = time.monotonic()
            seconds.append(after - before)
            before = after
            if sum(seconds) * SAVING_SHARE > cost or self.evolution.finished:
                self.directory.save(self.evolution, seconds)
                before = time.monotonic()
                cost, seconds = before - after, []
            yield record

    def finish(self, stage: Stage = silent) -> Scores:
        """Choose and test the champion and write all its files; its scores.

        Args:
            stage: told what is done next.

        Raises:
            UserError: if it cannot be written.
        """
        self.evolution.release()
        with writing():
            scores = write_results(
                self.evolution, self._judges, self.directory, stage, self._threads
            )
        self.directory.mark_finished()
        return scores
