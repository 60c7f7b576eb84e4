"""Trials of many robots, for each of them one after the other without end.

The parts are those of evaluation: the same starts, disturbances and actions give the
same bits as `control.run_trials`.
"""

import numpy as np

from epuck_mj.environments.options import Options
from epuck_mj.errors import UserError
from epuck_mj.rungs.disturbed import DisturbedRobots, disturbed
from epuck_mj.rungs.late import with_late_commands
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import ControlStep, control_step
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.step.sensors import Reading, observe


class EndlessTrials:
    """Trials of `n` robots; those whose trial is over are put on new starts."""

    def __init__(self, options: Options, n: int):
        """Load the scene and allocate the robots.

        Args:
            options: what they are and do.
            n: number of robots.

        Raises:
            UserError: if robot or arena cannot be used.
        """
        self.task, self._options, self._n = options.task, options, n
        self.scene = load_scene(options.robot, options.arena, options.control_step)
        self._space = FreeSpace(self.scene, options.start_clearance)
        self._conditions = options.conditions
        self._simulator = robots_in(self.scene, n, options.threads)
        self._begun = False

    def begin(
        self, rng: np.random.Generator, starts: np.ndarray | None = None
    ) -> np.ndarray:
        """Observations `(n, 8)` of all robots on the starts of new trials.

        Args:
            rng: from which the randomness of these and of all later trials comes.
            starts: of these trials, `(n, 3)`: x, y [m], yaw [rad]; None for random
                ones.

        Raises:
            UserError: if noise needs more memory than there is.
        """
        # two streams: what is drawn for noise changes no start
        self._of_starts, self._of_noise = map(
            np.random.default_rng, rng.integers(2**63, size=2)
        )
        if starts is None:
            starts = self._space.sample(self._of_starts, self._n)
        met = self._drawn(self._n)
        self._robots = (
            with_late_commands(self._simulator, self._options.latency)
            if met is None
            else disturbed(self._simulator, met, self.task.control_step)
        )
        self._k = np.zeros(self._n, int)
        self._observation = self._seen(self._robots.reset(starts))
        self._begun = True
        return self._observation.copy()

    def step(self, action: np.ndarray) -> tuple[ControlStep, np.ndarray]:
        """One control step of all robots, and whose steps are over, `(n,)`.

        Args:
            action: `(n, 2)`: v in [0, 1] and w in [-1, 1], right positive.

        Raises:
            UserError: before the first trial, or if MuJoCo warns of a simulation that
                means nothing.
        """
        if not self._begun:
            raise UserError("expected reset() before step()")
        # the time of a robot alone is a number, as in evaluation
        k = self._k if self._n > 1 else int(self._k[0])
        step = control_step(
            self._robots, lambda _: action, self._observation, self.task, k
        )
        self._observation = step.observation.copy()
        self._k += 1
        return step, self._k >= self.task.steps

    def restart(self, which: np.ndarray) -> np.ndarray:
        """Observations `(k, 8)` of robots on the starts of their next trials.

        Args:
            which: numbers of these robots, `(k,)`.
        """
        starts = self._space.sample(self._of_starts, len(which))
        if isinstance(self._robots, DisturbedRobots):
            met = self._drawn(len(which))
            assert met is not None, "robots are disturbed in all trials or in none"
            self._robots.renew(which, met)
        self._k[which] = 0
        seen = self._seen(self._robots.restart(which, starts))
        self._observation[which] = seen
        return seen

    def poses(self) -> np.ndarray:
        """Where the robots are, `(n, 3)`: x, y [m], yaw [rad]."""
        return self._robots.poses()

    def _drawn(self, n: int) -> Disturbances | None:
        return self._conditions.draw(self._of_noise, n, self.task.steps)

    def _seen(self, reading: Reading) -> np.ndarray:
        return observe(reading.distance, self.task.sensor_range)
