"""Interface of every rung: robots that can be placed, driven and observed."""

from typing import Protocol

import numpy as np

from epuck_mj.step.control import Robots


class Simulator(Robots, Protocol):
    """Up to `capacity` robots of one scene, as `rungs.table.robots_in` makes them."""

    capacity: int

    def embody(self, mass: np.ndarray, friction: np.ndarray) -> None:
        """Give the robots bodies of their own, from the next reset on.

        Their wheels may turn faster than a firmware would ask for: larger ones do.

        Args:
            mass: of each robot against the scene's, `(robots,)`.
            friction: of all but its shell, likewise.
        """
        ...

    def disembody(self) -> None:
        """Give the robots the scene's body back, from the next reset on."""
        ...
