"""Several policies in one batch, each with as many robots as the others."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from epuck_mj.step.control import BatchPolicy, Everybody, Policy, started


class SideBySide:
    """A batch policy: each of several policies drives robots that stand in a row."""

    def __init__(self, parts: Sequence[BatchPolicy], counts: Sequence[int]):
        """Store the policies and how many robots each drives."""
        self._parts, self._counts = parts, counts
        self._ends = np.cumsum(counts)

    @classmethod
    def of(cls, policies: Sequence[Policy], n: int) -> Self:
        """Policies that drive `n` robots each."""
        return cls([Everybody(each) for each in policies], [n] * len(policies))

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(robots, 2)` for observations `(robots, 8)`."""
        seen = np.split(observation, self._ends[:-1])
        each = zip(self._parts, seen, strict=True)
        return np.concatenate([part(own) for part, own in each])

    def __getitem__(self, index: Any) -> Self:
        """The members that a mask `(robots,)` or a slice selects."""
        mask = np.zeros(self._ends[-1], bool)
        mask[index] = True
        parts, counts = [], []
        for part, own in zip(self._parts, np.split(mask, self._ends[:-1]), strict=True):
            # policies without a robot are not called any more
            if own.any():
                parts.append(part[own])
                counts.append(int(own.sum()))
        return type(self)(parts, counts)

    def started(self, n: int | None) -> Self:
        """See `Remembering`."""
        each = zip(self._parts, self._counts, strict=True)
        return type(self)([started(part, count) for part, count in each], self._counts)
