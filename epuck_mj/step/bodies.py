"""Bodies: how the bodies of robots differ from that of their scene."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

SPARE_SPEED = 2.0
"""Highest wheel speed of embodied robots, as a multiple of the actuators' limits."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """Bodies of robots `(n,)`.

    Attributes:
        mass: against the scene's.
        friction: of all geoms but the shell, likewise.
        lag: of the drive's time constants, likewise.
        wider: how much larger the radius of the shell is [m].
        set_back: how much farther behind the shell the sensors are [m].
    """

    mass: np.ndarray
    friction: np.ndarray
    lag: np.ndarray
    wider: np.ndarray
    set_back: np.ndarray

    @classmethod
    def own(cls, n: int) -> Self:
        """Bodies of `n` robots that are as their scene says."""
        return cls(np.ones(n), np.ones(n), np.ones(n), np.zeros(n), np.zeros(n))

    def __len__(self) -> int:
        """Number of robots."""
        return len(self.mass)

    def __getitem__(self, index: np.ndarray | slice) -> Self:
        """Bodies of some robots, by numpy's indexing."""
        return type(self)(*(getattr(self, each.name)[index] for each in fields(self)))

    def put(self, which: np.ndarray | slice, others: Self) -> None:
        """Put other bodies in the place of those of some robots, in the arrays."""
        for each in fields(self):
            getattr(self, each.name)[which] = getattr(others, each.name)

    @property
    def outward(self) -> np.ndarray:
        """How far the sensors are from where the scene has them [m], `(n,)`.

        They move with the shell, each along its ray; positive is away from the axle.
        """
        return self.wider - self.set_back

    @property
    def shaped(self) -> bool:
        """Whether any has another shape than its scene's robot."""
        return bool(self.wider.any() or self.set_back.any())

    @property
    def changed(self) -> bool:
        """Whether any differs from its scene's robot."""
        others = (self.mass, self.friction, self.lag)
        return self.shaped or any(bool((each != 1).any()) for each in others)
