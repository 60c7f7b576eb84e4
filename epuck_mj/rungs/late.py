"""Robots whose commands come late, and that are ideal otherwise."""

import numpy as np

from epuck_mj.step.control import Robots
from epuck_mj.step.sensors import Reading


def with_late_commands(robots: Robots, late: int) -> Robots:
    """Robots that carry out a command so many control steps late; 0 changes nothing."""
    return LateRobots(robots, late) if late else robots


class LateRobots:
    """Robots that stand still until their first command has arrived."""

    def __init__(self, robots: Robots, late: int):
        """Put a delay of `late` control steps before robots."""
        self._robots, self._late = robots, late

    def reset(self, starts: np.ndarray) -> Reading:
        """See `Robots.reset`."""
        # on the way, the oldest first
        self._sent = [np.zeros((len(starts), 2)) for _ in range(self._late)]
        return self._robots.reset(starts)

    def step(self, command: np.ndarray) -> Reading:
        """See `Robot.step`."""
        self._sent.append(command)
        return self._robots.step(self._sent.pop(0))

    def keep(self, mask: np.ndarray) -> None:
        """See `Robots.keep`."""
        self._robots.keep(mask)
        self._sent = [command[mask] for command in self._sent]

    def restart(self, which: np.ndarray, starts: np.ndarray) -> Reading:
        """See `Robots.restart`."""
        # copies, because the caller owns the arrays
        self._sent = [command.copy() for command in self._sent]
        for command in self._sent:
            command[which] = 0.0
        return self._robots.restart(which, starts)

    def poses(self) -> np.ndarray:
        """See `Robots.poses`."""
        return self._robots.poses()

    def clearances(self) -> np.ndarray:
        """See `Robot.clearances`."""
        return self._robots.clearances()
