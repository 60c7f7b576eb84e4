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
        # undo the bodies of earlier disturbances
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
        self._control_step = control_step

    def reset(self, starts: np.ndarray) -> Reading:
        """See `Robots.reset`.

        Raises:
            ValueError: if there are not as many starts as disturbances.
        """
        given = self._disturbances
        if len(starts) != len(given):
            raise ValueError(f"expected {len(given)} starts, got {len(starts)}")
        self._of, self._k = given.of, np.zeros(len(starts), int)
        self._share = given.age / self._control_step
        # the robot stands: older commands were 0
        self._sent = np.zeros((len(starts), given.latency.max() + 1, 2))
        self._robots.embody(given.bodies)
        reading = self._robots.reset(starts)
        self._before = _within_reach(reading.distance)
        return self._sensed(reading, slice(None))

    def renew(self, which: np.ndarray, disturbances: Disturbances) -> None:
        """Give robots `(k,)` other disturbances, from their restart on.

        Raises:
            ValueError: if robots share disturbances.
        """
        given = self._disturbances
        given.renew(which, disturbances)
        self._share[which] = given.age[which] / self._control_step
        # the farthest that a command may be on its way
        more = given.latency.max() + 1 - self._sent.shape[1]
        if more > 0:
            self._sent = np.pad(self._sent, ((0, 0), (0, more), (0, 0)))

    def restart(self, which: np.ndarray, starts: np.ndarray) -> Reading:
        """See `Robots.restart`; other disturbances come by `renew`."""
        given = self._disturbances
        self._k[which], self._sent[which] = 0, 0.0
        self._robots.embody(given.bodies[which], which)
        reading = self._robots.restart(which, starts)
        self._before[which] = _within_reach(reading.distance)
        return self._sensed(reading, which)

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
        return self._sensed(self._robots.step(wheels), slice(None))

    def keep(self, mask: np.ndarray) -> None:
        """See `Robots.keep`."""
        self._robots.keep(mask)
        self._of, self._sent = self._of[mask], self._sent[mask]
        self._before, self._k = self._before[mask], self._k[mask]

    def poses(self) -> np.ndarray:
        """See `Robots.poses`."""
        return self._robots.poses()

    def clearances(self) -> np.ndarray:
        """See `Robot.clearances`."""
        return self._robots.clearances()

    def _sensed(self, reading: Reading, which: np.ndarray | slice) -> Reading:
        """The disturbed reading of some robots, with the true distances."""
        given, of, k = self._disturbances, self._of[which], self._k[which]
        truth, before = _within_reach(reading.distance), self._before[which].copy()
        self._before[which] = truth
        # of what is seen twice, readings are between the two
        aged = truth + (before - truth) * self._share[of]
        aged = np.where((truth < 0) | (before < 0), truth, aged)
        counts = counted(aged, given.gains[of], given.count_noise[of, k])
        distance = sensed_distance(counts, given.known_gains[of])
        return Reading(distance, reading.contact, counts, reading.distance)


def _within_reach(distance: np.ndarray) -> np.ndarray:
    """Distances `(..., 8)`, negative beyond the sensors' reach: they see nothing."""
    return np.where(distance > PROXIMITY_REACH, -1.0, distance)
