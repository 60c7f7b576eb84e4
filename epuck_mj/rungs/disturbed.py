"""Simulated robots with the sensors and motors of real ones.

The firmware rounds commands to whole steps per second. The sensors count, and their
counts are converted back into metres as the bridge does on a robot.
"""

import numpy as np

from epuck_mj.rungs.simulator import Simulator
from epuck_mj.step.control import Robots
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.step.motors import actual_rates, step_rates, wheel_speeds
from epuck_mj.step.sensors import PROXIMITY_REACH, Reading, counted, sensed_distance


def disturbed(
    robots: Simulator, disturbances: Disturbances | None, control_step: float
) -> Robots:
    """Robots with these disturbances, or the robots unchanged if there are none.

    Args:
        robots: that drive.
        disturbances: of each of them.
        control_step: its duration [s].
    """
    if disturbances is None:
        # nothing is left of those before
        robots.disembody()
        return robots
    return DisturbedRobots(robots, disturbances, control_step)


class DisturbedRobots:
    """Robots whose commands and readings are disturbed."""

    def __init__(
        self,
        robots: Simulator,
        disturbances: Disturbances,
        control_step: float,
    ):
        """Put disturbances around robots.

        Args:
            robots: that drive.
            disturbances: of each of them.
            control_step: its duration [s].
        """
        self._robots = robots
        self._disturbances = disturbances
        self._share = disturbances.age / control_step

    def reset(self, starts: np.ndarray) -> Reading:
        """See `Robots.reset`.

        Raises:
            ValueError: if there are not as many starts as disturbances.
        """
        given = self._disturbances
        if len(starts) != len(given):
            raise ValueError(f"expected {len(given)} starts, got {len(starts)}")
        self._of, self._k = given.of, 0
        # the robot stands: older commands were 0
        self._sent = np.zeros((len(starts), given.latency.max() + 1, 2))
        self._robots.embody(
            given.mass[given.of], given.friction[given.of], given.lag[given.of]
        )
        reading = self._robots.reset(starts)
        self._before = reading.distance
        self._before = np.where(self._before > PROXIMITY_REACH, -1.0, self._before)
        return self._sensed(reading)

    def step(self, command: np.ndarray) -> Reading:
        """See `Robot.step`."""
        given, of = self._disturbances, self._of
        self._sent = np.roll(self._sent, 1, axis=1)
        self._sent[:, 0] = command
        arrived = self._sent[np.arange(len(of)), given.latency[of]]
        wheels = wheel_speeds(actual_rates(step_rates(arrived)))
        wheels *= given.wheel_gains[of] * (1 + given.wheel_noise[of, self._k])
        # another track turns the robot less, or more, at the same speed
        mean = wheels.mean(axis=-1, keepdims=True)
        wheels = mean + (wheels - mean) * given.turn_gain[of, None]
        self._k += 1
        return self._sensed(self._robots.step(wheels))

    def keep(self, mask: np.ndarray) -> None:
        """See `Robots.keep`."""
        self._robots.keep(mask)
        self._of, self._sent = self._of[mask], self._sent[mask]
        self._before = self._before[mask]

    def poses(self) -> np.ndarray:
        """See `Robots.poses`."""
        return self._robots.poses()

    def clearances(self) -> np.ndarray:
        """See `Robot.clearances`."""
        return self._robots.clearances()

    def _sensed(self, reading: Reading) -> Reading:
        """The disturbed reading, with the true distances."""
        given, of = self._disturbances, self._of
        # beyond their reach, sensors see nothing
        seen = np.where(reading.distance > PROXIMITY_REACH, -1.0, reading.distance)
        truth, before = seen, self._before
        self._before = truth
        # of what is seen twice, readings are between the two
        aged = truth + (before - truth) * self._share[of]
        aged = np.where((truth < 0) | (before < 0), truth, aged)
        counts = counted(aged, given.gains[of], given.count_noise[of, self._k])
        distance = sensed_distance(counts, given.known_gains[of])
        return Reading(distance, reading.contact, counts, reading.distance)
