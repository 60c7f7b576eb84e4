"""Controllers that explore: they add something to the sums of their outputs.

So actions stay within their limits, and the probability of what was tried has a simple
derivative: see `gradient`.
"""

from typing import Any, Self

import numpy as np

from epuck_mj.policies.network import Controller, squashed


class Exploring:
    """A batch policy `(n,)` that tries something else in each control step."""

    def __init__(self, controller: Controller, tried: np.ndarray, k: int = 0):
        """Store who explores, and what.

        Args:
            controller: `(n,)` of them.
            tried: added to the weighted sums of v and w, `(n, steps, 2)`.
            k: number of the next control step.
        """
        self._controller, self._tried, self._k = controller, tried, k

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(n, 2)` for observations `(n, 8)`, one control step after another.

        Those of `rungs.kinematic.drivers.act`, to the bit.
        """
        tried = self._tried[:, self._k]
        self._k += 1
        return squashed(self._controller.sums(observation) + tried)

    def __getitem__(self, index: Any) -> Self:
        """The members that a mask `(n,)` or a slice selects, at the same step."""
        return type(self)(self._controller[index], self._tried[index], self._k)

    def started(self, n: int | None) -> Self:
        """See `control.Remembering`: the first control step comes next."""
        return type(self)(self._controller, self._tried)
