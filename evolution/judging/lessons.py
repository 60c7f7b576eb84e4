"""Lessons: trials of learners, whose steps are written down."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.policies.exploring import Exploring
from epuck_mj.policies.network import Controller, Network
from epuck_mj.policies.topology import Topology
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import compiled_trials, robots_in
from epuck_mj.scene.model import Scene
from epuck_mj.step.control import Everybody, TaskParameters, Trials
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.recorder import record_lessons
from evolution.judging.evaluation import CAPACITY
from evolution.search.lessons import Demonstration, Life


class LessonRobots:
    """Robots of one scene that learners drive."""

    def __init__(self, scene: Scene, task: TaskParameters, threads: int = 0):
        """Allocate them; `threads` step them, 0 is one per core."""
        self.task = task
        self._robots = robots_in(scene, CAPACITY, threads)
        self._compiled = compiled_trials(scene, task, threads)

    def explored(
        self,
        controller: Controller,
        starts: np.ndarray,
        disturbances: Disturbances | None,
        tried: np.ndarray,
    ) -> tuple[Trials, np.ndarray, np.ndarray]:
        """See `CompiledTrials.explored`; the same bits where nothing is compiled."""
        if self._compiled is not None:
            return self._compiled.explored(controller, starts, disturbances, tried)
        policy = Exploring(controller, tried)
        return record_lessons(self._robots, policy, starts, self.task, disturbances)

    def demonstrated(
        self, starts: np.ndarray, disturbances: Disturbances | None
    ) -> tuple[Trials, np.ndarray]:
        """Trials of the hand-written wall follower, and what it observed in them."""
        policy = Everybody(WallFollower())
        trials, seen, _ = record_lessons(
            self._robots, policy, starts, self.task, disturbances
        )
        return trials, seen


@dataclass(frozen=True)
class Circumstances:
    """What the trials of one lesson have in common.

    Attributes:
        starts: `(trials, 3)`.
        disturbances: of `(trials,)`; None for ideal robots.
        rng: draws what is tried.
    """

    starts: np.ndarray
    disturbances: Disturbances | None
    rng: np.random.Generator


class GivenLessons:
    """Lessons of one generation; a `Lessons`.

    Attributes:
        network: what genomes decode to.
        cost: evaluations that lessons have cost so far.
        control_steps: that were simulated in them.
    """

    def __init__(
        self,
        robots: LessonRobots,
        topology: Topology,
        circumstances: Callable[[int, int], Circumstances],
        trials: int,
    ):
        """Store where lessons are lived.

        Args:
            robots: that learners drive.
            topology: what genomes decode to.
            circumstances: of a lesson, by its number in this generation and the number
                of its trials.
            trials: of an evaluation.

        Raises:
            UserError: as `learnable`.
        """
        self.network = learnable(topology)
        self.cost = self.control_steps = 0
        self._robots, self._trials = robots, trials
        self._circumstances, self._given = circumstances, 0

    def live(self, genomes: np.ndarray, exploration: float) -> Life:
        """See `Lessons`."""
        n, trials, steps = len(genomes), self._trials, self._robots.task.steps
        met = self._next(trials)
        self.cost += n
        tried = exploration * met.rng.standard_normal((n * trials, steps, 2))
        everybody = None if met.disturbances is None else met.disturbances.tiled(n)
        happened, observation, reward = self._robots.explored(
            self.network.decode(np.repeat(genomes, trials, axis=0)),
            np.tile(met.starts, (n, 1)),
            everybody,
            tried,
        )
        self.control_steps += int(happened.steps.sum())
        lived = np.arange(steps) < happened.steps[:, None]
        each = (observation, tried, reward, lived)
        return Life(*(array.reshape(n, trials, *array.shape[1:]) for array in each))

    def demonstrate(self, evaluations: int) -> Demonstration:
        """See `Lessons`."""
        met = self._next(evaluations * self._trials)
        self.cost += evaluations
        happened, seen = self._robots.demonstrated(met.starts, met.disturbances)
        self.control_steps += int(happened.steps.sum())
        lived = np.arange(seen.shape[1]) < happened.steps[:, None]
        return Demonstration(seen[lived], WallFollower()(seen[lived]))

    def _next(self, trials: int) -> Circumstances:
        self._given += 1
        return self._circumstances(self._given, trials)


def learnable(topology: Topology) -> Network:
    """The network, if it is one that can be given lessons.

    Raises:
        UserError: if it is another one, of which there are no gradients.
    """
    if not isinstance(topology, Network):
        raise UserError(
            "an optimiser that learns needs gradients: expected network feedforward, "
            f"got {topology}"
        )
    return topology
