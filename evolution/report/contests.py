"""Experiments compared pair by pair.

Of one question, a measure or a criterion on a robot, there are two families: all pairs
of the study's first three experiments, and each other experiment with the first. P
values are Holm-adjusted in their family, so that a comparison has one adjusted p and
baselines do not cost the main question its power.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from evolution.statistics.significance import FEWEST_FOR_STARS, LEVELS, holm

COMPARED_PAIRWISE = 3
"""Number of a study's first experiments that are compared pair by pair: the paper's."""


@dataclass(frozen=True, eq=False)
class Contest:
    """Two experiments that are compared.

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
        """Whether there are enough runs for a verdict."""
        return min(self.of_a.size, self.of_b.size) >= FEWEST_FOR_STARS

    @property
    def decided(self) -> bool:
        """Whether the runs show that the two differ."""
        return self.enough and self.p_holm < LEVELS[0]


def families(names: Sequence[str]) -> list[list[tuple[str, str]]]:
    """Pairs of experiments that are compared, by family, in the experiments' order."""
    first, others = names[:COMPARED_PAIRWISE], names[COMPARED_PAIRWISE:]
    pairs = list(combinations(first, 2)), [(names[0], other) for other in others]
    return [family for family in pairs if family]


def contests(
    samples: Mapping[str, np.ndarray],
    alike: Callable[[str, str], bool],
    p_value: Callable[[np.ndarray, np.ndarray], float],
) -> list[Contest]:
    """A contest per pair of experiments that are compared, in their order.

    Args:
        samples: of each experiment, `(runs,)`, none of them empty.
        alike: whether two experiments can be compared.
        p_value: of the test of two samples.
    """
    found = []
    for family in families(list(samples)):
        pairs = [pair for pair in family if alike(*pair)]
        if not pairs:
            continue
        p_values = [p_value(samples[a], samples[b]) for a, b in pairs]
        adjusted = holm(np.array(p_values)).tolist()
        found += [
            Contest(a, b, samples[a], samples[b], p, p_holm, len(pairs))
            for (a, b), p, p_holm in zip(pairs, p_values, adjusted, strict=True)
        ]
    return found
