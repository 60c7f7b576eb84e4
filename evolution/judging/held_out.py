"""Held-out evaluation: what fresh starts say of a controller, and what it does there.

The numbers that a study reports.
"""

from collections.abc import Callable
from functools import cache
from typing import Self

import numpy as np

from epuck_mj.rungs.mujoco_batch import SimulatedRobots
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.scene.wall_loops import wall_loops
from epuck_mj.step.control import Policy, TaskParameters
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.behaviour_classes import class_shares
from epuck_mj.trials.metrics import behaviour
from epuck_mj.trials.tracks import record_tracks
from evolution.judging.evaluation import CAPACITY
from evolution.judging.scores import HeldOut
from evolution.judging.starts import N_TEST, starts_for_test
from evolution.settings.setting import Setting
from evolution.statistics.samples import mean_interval, worst_share_mean

WHEELED_ROBOT, PLANAR_ROBOT = "epuck", "epuck_planar"
"""Every champion is reported on the first, whatever it was evolved on, and what was
evolved on it on the second as well."""

INTERVAL_SEED = 0
"""Of the bootstrap's resamples, so that the same trials give the same interval."""


class Everybody:
    """A batch policy whose members are all the same."""

    def __init__(self, policy: Policy):
        """Name the policy of them all."""
        self._policy = policy

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(robots, 2)` for observations `(robots, 8)`."""
        return self._policy(observation)

    def __getitem__(self, index: np.ndarray | slice) -> Self:
        """Itself."""
        return self


Judging = Callable[[str, Setting], "Judge"]
"""Gives the judge of a robot in a setting."""


def judging(threads: int = 0) -> Judging:
    """Gives the judge of a robot in a setting, the same one again: they take a second.

    Args:
        threads: that step the robots; 0 is one per core.

    Returns:
        A function of robot and setting.
    """

    @cache
    def judge(robot: str, setting: Setting) -> Judge:
        task = setting.task
        scene = load_scene(robot, setting.arena, task.control_step)
        return Judge(scene, task, setting.start_clearance, threads)

    return judge


def tested_on(robot: str) -> list[str]:
    """Robots that champions of a robot are tested on: itself, and the other kind."""
    other = PLANAR_ROBOT if robot == WHEELED_ROBOT else WHEELED_ROBOT
    return list(dict.fromkeys([robot, other]))


class Judge:
    """Tests controllers in one scene."""

    def __init__(
        self,
        scene: Scene,
        task: TaskParameters,
        start_clearance: float,
        threads: int = 0,
    ):
        """Measure the arena.

        Args:
            scene: robot and arena.
            task: what a trial is.
            start_clearance: least distance from the shell to a wall at a start [m].
            threads: that step the robots; 0 is one per core.

        Raises:
            UserError: if the arena has no room, or a wall of which no clearance can be
                measured.
        """
        self.scene = scene
        self._space = FreeSpace(scene, start_clearance)
        self._task = task
        self._threads = threads
        self._probe = ClearanceProbe(scene, threads)
        self._loops = wall_loops(scene, self._probe)

    def starts(self, n: int = N_TEST) -> np.ndarray:
        """The first of the test starts of this scene, `(n, 3)`."""
        return starts_for_test(self._space, n)

    def test(
        self,
        policy: Policy,
        n: int = N_TEST,
        disturbances: Disturbances | None = None,
    ) -> HeldOut:
        """What the first `n` test starts say of a policy, one for all of them.

        Args:
            policy: to test.
            n: number of starts.
            disturbances: of the `n` trials; None for ideal robots.
        """
        robots = SimulatedRobots(self.scene, min(CAPACITY, n), self._threads)
        everybody, starts = Everybody(policy), self.starts(n)
        tracks = record_tracks(robots, everybody, starts, self._task, disturbances)
        clearance = self._probe.measure(tracks.pose)
        did = behaviour(tracks, clearance, self._loops, self._task)
        fitness = tracks.trial_fitness
        interval = mean_interval(fitness, np.random.default_rng(INTERVAL_SEED))
        return HeldOut(
            mean=float(fitness.mean()),
            standard_deviation=float(fitness.std(ddof=1)),
            interval=(interval.low, interval.high),
            worst=worst_share_mean(fitness),
            crash_rate=float(tracks.crashed.mean()),
            collisions_per_minute=did.collisions_per_minute,
            starts=n,
            behaviour=class_shares(did),
            metrics={
                name: None if np.isnan(value) else value
                for name, value in did.means.items()
            },
        )
