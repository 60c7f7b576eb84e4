"""Experiments held against each other, pair by pair.

P values are Holm-adjusted. The family is all pairs of experiments within one question,
a measure or a criterion on a robot: each such table is a question of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from evolution.statistics.significance import FEWEST_FOR_STARS, LEVELS, holm


@dataclass(frozen=True, eq=False)
class Contest:
    """Two experiments held against each other.

    Attributes:
        a: name of the first experiment.
        b: name of the second.
        of_a: sample of the first, `(n,)`.
        of_b: sample of the second, `(m,)`.
        p: of the test, two-sided.
        p_holm: adjusted for the family.
        family: tests in it.
    """

    a: str
    b: str
    of_a: np.ndarray
    of_b: np.ndarray
    p: float
    p_holm: float
    family: int

    @property
    def enough(self) -> bool:
        """Whether there are runs enough for a verdict."""
        return min(self.of_a.size, self.of_b.size) >= FEWEST_FOR_STARS

    @property
    def decided(self) -> bool:
        """Whether they say that the two differ."""
        return self.enough and self.p_holm < LEVELS[0]


def contests(
    samples: Mapping[str, np.ndarray],
    alike: Callable[[str, str], bool],
    p_value: Callable[[np.ndarray, np.ndarray], float],
) -> list[Contest]:
    """A contest per pair of experiments that can be compared, in their order.

    Args:
        samples: of each experiment, `(runs,)`, none of them empty.
        alike: whether two experiments can be compared.
        p_value: of the test of two samples.
    """
    pairs = [pair for pair in combinations(samples, 2) if alike(*pair)]
    if not pairs:
        return []
    p_values = [p_value(samples[a], samples[b]) for a, b in pairs]
    adjusted = holm(np.array(p_values)).tolist()
    return [
        Contest(a, b, samples[a], samples[b], p, p_holm, len(pairs))
        for (a, b), p, p_holm in zip(pairs, p_values, adjusted, strict=True)
    ]
