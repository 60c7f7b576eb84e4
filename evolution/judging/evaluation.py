"""Evaluation: fitness of genomes, all of a generation on the same trials.

Engines with the same bits: `batch` runs compiled trials of a kinematic robot, or steps
all MuJoCo robots at once on `mujoco.batch.Batch`; `dm_control` steps the dm_control
task, one trial after another; the cluster's sends trials to other machines.

Racing: some individuals matter only if they exceed a known fitness. The trials of such
an individual end as soon as it cannot exceed that fitness any more, since no control
step is worth more than the step fitness's maximum. An individual that exceeds it has
all its trials, so every comparison has the same outcome.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.network import Controller
from epuck_mj.policies.topology import Topology
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.late import with_late_commands
from epuck_mj.rungs.simulator import Simulator
from epuck_mj.rungs.table import compiled_trials, robots_in
from epuck_mj.rungs.warnings import unstable
from epuck_mj.scene.model import Scene
from epuck_mj.step.control import (
    BatchPolicy,
    Robots,
    TaskParameters,
    Trials,
    run_trials,
    started,
)
from epuck_mj.step.disturbances import Disturbances

CAPACITY = 512
"""Number of robots simulated at once, which fit the cache. Changes no result.

An individual with more trials is not raced.
"""

ROUNDING = 1e-9
"""Margin by which an individual must have lost its race, for rounding errors."""


@dataclass(frozen=True)
class Evaluation:
    """Trials of `(individuals,)` genomes on `(trials,)` starts.

    Of an individual that lost its race they are what they were when it was broken off.

    Attributes:
        trial_fitness: sum of the step fitness, `(individuals, trials)`.
        steps: control steps lived, `(individuals, trials)`.
        crashed: whether a crash ended the trial, `(individuals, trials)`.
    """

    trial_fitness: np.ndarray
    steps: np.ndarray
    crashed: np.ndarray

    @property
    def fitness(self) -> np.ndarray:
        """Mean over the trials, `(individuals,)`. Source: paper, section 4."""
        return self.trial_fitness.mean(axis=-1)


@dataclass(frozen=True)
class Race:
    """Fitness that individuals `(individuals,)` have to exceed to be kept.

    The trials of an individual follow one another.

    Attributes:
        to_beat: fitness to exceed, -inf where every fitness matters.
        trials: of each individual.
    """

    to_beat: np.ndarray
    trials: int

    def lost(self, most: np.ndarray) -> np.ndarray:
        """Which trials `(individuals * trials,)` can end, as their individual has lost.

        Args:
            most: what each of them can still reach.
        """
        fitness = most.reshape(-1, self.trials).mean(axis=-1)
        return np.repeat(fitness < self.to_beat - ROUNDING, self.trials)

    def __getitem__(self, chunk: slice) -> "Race":
        """The race of the individuals whose trials a slice holds."""
        first, last = chunk.start // self.trials, chunk.stop // self.trials
        return Race(self.to_beat[first:last], self.trials)


@dataclass(frozen=True)
class Work:
    """Trials `(n,)` to be simulated.

    Attributes:
        controller: one per trial.
        starts: poses `(n, 3)`: x, y [m], yaw [rad].
        race: which trials may be broken off; None if none may.
        disturbances: of the trials; None for ideal robots.
    """

    controller: BatchPolicy
    starts: np.ndarray
    race: Race | None = None
    disturbances: Disturbances | None = None

    def __len__(self) -> int:
        """Number of trials."""
        return len(self.starts)

    def __getitem__(self, chunk: slice) -> "Work":
        """Select trials; in a race, those of whole individuals."""
        race, met = self.race, self.disturbances
        return Work(
            self.controller[chunk],
            self.starts[chunk],
            None if race is None else race[chunk],
            None if met is None else met[chunk],
        )

    def chunks(self, most: int) -> Iterator["Work"]:
        """Parts of the work of at most so many trials.

        Individuals that race stay whole: they win or lose by all their trials.
        """
        whole = 1 if self.race is None else self.race.trials
        size = max(whole, most - most % whole)
        for first in range(0, len(self), size):
            yield self[first : min(first + size, len(self))]


class Engine(Protocol):
    """Interface of engines, which run one trial per member of a batch policy."""

    def run(self, work: Work) -> Trials:
        """Run `(n,)` trials; their outcome."""
        ...


class BatchEngine:
    """Engine that runs all trials at once, on threads."""

    def __init__(
        self, scene: Scene, task: TaskParameters, threads: int = 0, late: int = 0
    ):
        """Allocate the robots.

        Args:
            scene: robot and arena.
            task: what a trial is.
            threads: that step the robots; 0 is one per core.
            late: control steps until a command has reached the wheels of ideal robots.
        """
        self._task, self._late = task, late
        self._robots = robots_in(scene, CAPACITY, threads)
        self._compiled = compiled_trials(scene, task, threads, late)

    def run(self, work: Work) -> Trials:
        """See `Engine.run`."""
        if self._compiled is not None and isinstance(
            work.controller, Controller | WithChanges
        ):
            race = work.race or Race(np.full(len(work), -np.inf), 1)
            needed = (race.to_beat - ROUNDING) * race.trials
            return self._compiled(
                work.controller, work.starts, work.disturbances, race.trials, needed
            )
        if work.race is not None and work.race.trials > self._robots.capacity:
            # too few robots for all trials of an individual: no trial is ended early
            work = replace(work, race=None)
        return run_work(self._robots, work, self._task, self._late)


def run_work(
    robots: Simulator, work: Work, task: TaskParameters, late: int = 0
) -> Trials:
    """Simulate trials step by step, as many at a time as there are robots.

    Args:
        robots: that drive.
        work: the trials.
        task: what a trial is.
        late: control steps until a command has reached the wheels of ideal robots.
    """

    def driven(disturbances: Disturbances | None) -> Robots:
        ready = disturbed(robots, disturbances, task.control_step)
        return ready if disturbances is not None else with_late_commands(ready, late)

    parts = [
        run_trials(
            driven(part.disturbances),
            part.controller,
            part.starts,
            task,
            None if part.race is None else part.race.lost,
        )
        for part in work.chunks(robots.capacity)
    ]
    return Trials.joined(parts)


class DmControlEngine:
    """Engine that runs one trial after the other, on the dm_control task."""

    def __init__(self, scene: Scene, task: TaskParameters):
        """Store the scene; each call of `run` makes an environment."""
        self._scene = scene
        self._task = task

    def run(self, work: Work) -> Trials:
        """See `Engine.run`; every trial runs to its end, with an ideal robot.

        Raises:
            UserError: if MuJoCo warns of a simulation that means nothing.
            ValueError: if there are disturbances.
        """
        if work.disturbances is not None:
            raise ValueError("expected no disturbances with engine dm_control")
        # dm_control is slow to import
        from epuck_mj.environments.dm_control import (
            FollowWalls,
            PhysicsError,
            environment,
        )

        task = FollowWalls(self._scene, self._task, starts=work.starts)
        env, n = environment(self._scene, task), len(work)
        fitness, steps = np.zeros(n), np.zeros(n, int)
        crashed = np.zeros(n, bool)
        for i in range(n):
            policy, time_step = started(work.controller[i : i + 1], 1), env.reset()
            while not time_step.last():
                observation = time_step.observation["proximity"]
                try:
                    time_step = env.step(policy(observation[None])[0])
                except PhysicsError as problem:
                    raise unstable(self._scene, str(problem)) from None
                fitness[i] += time_step.reward
                steps[i] += 1
            crashed[i] = task.crashed(env.physics)
        return Trials(fitness, steps, crashed)


def evaluate(
    engine: Engine,
    topology: Topology,
    genomes: np.ndarray,
    starts: np.ndarray,
    to_beat: np.ndarray | None = None,
    disturbances: Disturbances | None = None,
) -> Evaluation:
    """Evaluate all individuals, on the same starts or each on its own.

    Args:
        engine: what runs the trials.
        topology: what genomes decode to.
        genomes: `(individuals, genes)`.
        starts: poses `(trials, 3)`, x, y [m], yaw [rad], for all individuals; or
            `(individuals, trials, 3)`, each one's own.
        to_beat: fitness `(individuals,)` that each has to exceed to matter; None if
            every fitness matters.
        disturbances: of the trials, for all individuals; None for ideal robots.
    """
    shape = (len(genomes), starts.shape[-2])
    controller = topology.decode(np.repeat(genomes, shape[1], axis=0))
    race = None if to_beat is None else Race(to_beat, shape[1])
    everybody = None if disturbances is None else disturbances.tiled(len(genomes))
    everywhere = np.broadcast_to(starts, (*shape, 3)).reshape(-1, 3)
    trials = engine.run(Work(controller, everywhere, race, everybody))
    return Evaluation(
        trials.fitness.reshape(shape),
        trials.steps.reshape(shape),
        trials.crashed.reshape(shape),
    )
