"""Held-out evaluation: fitness and behaviour of a controller on new starts.

These are the numbers that a study reports.
"""

from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.policies.topology import Topology
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import is_kinematic, on_wheels, without_physics
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.scene.wall_loops import wall_loops
from epuck_mj.step.control import Everybody, Policy, TaskParameters
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.behaviour_classes import class_shares
from epuck_mj.trials.metrics import behaviour_of
from epuck_mj.trials.recorder import record_tracks
from evolution.judging.evaluation import CAPACITY, BatchEngine, evaluate
from evolution.judging.held_out_starts import starts_for_test
from evolution.judging.scores import HeldOut
from evolution.settings.setting import Setting
from evolution.statistics.estimates import mean_interval, worst_share_mean

INTERVAL_SEED = 0
"""Seed of the bootstrap, so that the same trials give the same interval."""


def tested_on(robot: str) -> list[str]:
    """Robots on which a robot's champions are tested; one is a shipped one on wheels.

    Stored fitness is compared with tests on the first: on wheels for champions of
    kinematic robots, too.
    """
    wheels, kinematic = on_wheels(robot), without_physics(robot)
    return [wheels, kinematic] if robot in (wheels, kinematic) else [robot, wheels]


class Judges:
    """Judges by robot and setting, each made at its first use."""

    def __init__(self, threads: int = 0):
        """Start without judges; `threads` step the robots, 0 is one per core."""
        self._threads = threads
        self._made: dict[tuple[str, Setting], Judge] = {}
        self._refused: dict[tuple[str, Setting], str | None] = {}

    def add(self, robot: str, setting: Setting, scene: Scene, space: FreeSpace) -> None:
        """Add a judge that uses an existing scene and free space.

        Args:
            robot: name or path of the robot.
            setting: in what it is tested.
            scene: that robot in that setting's arena.
            space: where it may start.
        """
        judge = Judge(scene, space, setting.task, self._threads)
        self._made[robot, setting] = judge

    def of(self, robot: str, setting: Setting) -> "Judge":
        """The judge of a robot, given by name or path, in a setting.

        Raises:
            UserError: if the robot cannot use the arena, the arena has no room, or it
                has a wall of which no clearance can be measured.
        """
        if (robot, setting) not in self._made:
            scene = load_scene(robot, setting.arena, setting.task.control_step)
            space = FreeSpace(scene, setting.start_clearance)
            self.add(robot, setting, scene, space)
        return self._made[robot, setting]

    def refusal(self, robot: str, setting: Setting) -> str | None:
        """Why champions are not tested on a robot in an arena, in one line; or None.

        Only a kinematic robot may be left out: where a wall has no exact outline it
        cannot drive, and a test on wheels is enough.

        Raises:
            UserError: as `of`.
        """
        if not is_kinematic(robot):
            return None
        if (robot, setting) not in self._refused:
            refusal, scene = None, self.of(robot, setting).scene
            try:
                robots_in(scene, 1, self._threads)
            except UserError as problem:
                refusal = f"not tested on {robot}: {problem}"
            self._refused[robot, setting] = refusal
        return self._refused[robot, setting]

    def refusals(self, robot: str, setting: Setting) -> list[str]:
        """Why champions are not tested on some robots of `tested_on`, a line each."""
        found = [self.refusal(each, setting) for each in tested_on(robot)]
        return [refusal for refusal in found if refusal is not None]

    def tested_on(self, robot: str, setting: Setting) -> dict[str, "Judge"]:
        """The judges of a robot's champions, by robot, as `tested_on` orders them.

        Raises:
            UserError: as `of`.
        """
        return {
            Path(each).name: self.of(each, setting)
            for each in tested_on(robot)
            if self.refusal(each, setting) is None
        }


class Judge:
    """Judge that tests controllers in one scene."""

    def __init__(
        self, scene: Scene, space: FreeSpace, task: TaskParameters, threads: int = 0
    ):
        """Measure the arena.

        Args:
            scene: robot and arena.
            space: where the robot may start.
            task: what a trial is.
            threads: that step the robots; 0 is one per core.

        Raises:
            UserError: if the arena has a wall of which no clearance can be measured.
        """
        self.scene = scene
        self._space = space
        self._task = task
        self._threads = threads
        self._probe = ClearanceProbe(scene, threads)
        self._loops = wall_loops(scene)

    def starts(self, n: int) -> np.ndarray:
        """The first of the test starts of this scene, `(n, 3)`."""
        return starts_for_test(self._space, n)

    def fitness(self, topology: Topology, genome: np.ndarray, n: int) -> float:
        """Mean fitness of a genome `(genes,)` on the first `n` test starts.

        The mean of `test` on ideal robots, without what is measured of behaviour, which
        costs far more on the kinematic robot.
        """
        engine = BatchEngine(self.scene, self._task, self._threads)
        return float(
            evaluate(engine, topology, genome[None], self.starts(n)).fitness[0]
        )

    def test(
        self,
        policy: Policy,
        n: int,
        disturbances: Disturbances | None = None,
    ) -> HeldOut:
        """Test a policy on the first `n` test starts.

        Args:
            policy: to test.
            n: number of starts.
            disturbances: of the `n` trials; None for ideal robots.
        """
        robots = robots_in(self.scene, min(CAPACITY, n), self._threads)
        everybody, starts = Everybody(policy), self.starts(n)
        tracks = record_tracks(robots, everybody, starts, self._task, disturbances)
        clearance = self._probe.measure(tracks.pose)
        did = behaviour_of(tracks, clearance, self._loops, self._task)
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
