"""Odometry: where a robot is, from the steps that its motors have made."""

import numpy as np

from epuck_mj.bridge.failures import RobotRestarted
from epuck_mj.bridge.language.replies import Steps, wrapped
from epuck_mj.constants import STEP_RATE_MAX_2
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.motors import STEP_ANGLE

SLACK = 50
"""Steps that a motor may make beyond its highest rate. Chosen.

An emulated robot's counters go by physics steps; after a reset they go by thousands.
"""


class Odometry:
    """Pose and path of a robot whose counters wrap at 16 bits.

    Attributes:
        pose: `(3,)`: x, y [m], yaw [rad].
        length: of the path of the axle's middle [m].
        steps: that both motors have made since the first call, not wrapped, `(2,)`.
    """

    def __init__(self, calibration: Calibration, start: np.ndarray) -> None:
        """Start with a robot at rest.

        Args:
            calibration: the robot's wheel radii and track.
            start: pose `(3,)`: x, y [m], yaw [rad].
        """
        self._step_lengths = STEP_ANGLE * np.array(calibration.wheel_radii)
        self._track = calibration.track
        self._counters: Steps | None = None
        self._asked = 0.0
        self.pose = np.array(start, float)
        self.length = 0.0
        self.steps = np.zeros(2)

    def update(self, counters: Steps, asked: float, now: float) -> None:
        """Move by the counters' change; the first call only sets their start.

        Both wheels' speeds are taken as constant since the last call: an arc.

        Args:
            counters: as the robot reports them.
            asked: when it was asked [s]; it looked between then and now.
            now: the time [s].

        Raises:
            RobotRestarted: if no motor can have made so many steps.
        """
        before, self._counters = self._counters or counters, counters
        # the longest time that can lie between the two looks
        elapsed, self._asked = now - self._asked, asked
        left, right = counters.left - before.left, counters.right - before.right
        steps = np.array([wrapped(left), wrapped(right)])
        possible = STEP_RATE_MAX_2 * elapsed + SLACK
        if np.abs(steps).max() > possible:
            raise RobotRestarted(
                f"at most {possible:.0f} steps in {elapsed:.3f} s",
                f"{steps[0]} and {steps[1]}: the robot was reset",
            )
        self.steps = self.steps + steps
        left, right = steps * self._step_lengths
        distance, turn = (left + right) / 2, (right - left) / self._track
        # the chord of the arc, in the direction half-way round
        chord = distance * np.sinc(turn / (2 * np.pi))
        middle = self.pose[2] + turn / 2
        self.pose = self.pose + np.array(
            (chord * np.cos(middle), chord * np.sin(middle), turn)
        )
        self.length += abs(distance)
