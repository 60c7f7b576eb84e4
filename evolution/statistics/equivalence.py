"""Equivalence: two one-sided tests that samples differ by less than a margin.

The unit is the run: samples are `(n,)` and `(m,)`, one value per run. A difference test
that finds nothing says only that nothing was found; this test says that a difference as
large as the margin is excluded.
"""

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from evolution.statistics.estimates import checked_sample
from evolution.statistics.significance import LEVELS

SHIFT_CONFIDENCE = 0.9
"""Of the interval of the shift: it lies within the margin where p is below 0.05."""


@dataclass(frozen=True)
class Equivalence:
    """Outcome of an equivalence test.

    Attributes:
        shift: Hodges-Lehmann estimate of how much the first sample exceeds the second.
        low: lower bound of its 90 % interval.
        high: upper bound.
        margin: shifts smaller than this count as none.
        p: of the hypothesis that the shift is at least the margin, in either direction.
    """

    shift: float
    low: float
    high: float
    margin: float
    p: float

    def turned(self) -> Self:
        """The same test with the second sample first."""
        return replace(self, shift=-self.shift, low=-self.high, high=-self.low)

    def verdict(self, p: float) -> str:
        """The first sample is better or worse than the second; or both are equivalent.

        Args:
            p: of a difference; if the comparison is one of a family, adjusted for it,
                as that of the equivalence.
        """
        if p < LEVELS[0]:
            return "better" if self.shift > 0 else "worse"
        return "equivalent" if self.p < LEVELS[0] else "undecided"

    def __str__(self) -> str:
        """The shift and its interval."""
        return f"{self.shift:z.1f} [{self.low:z.1f}, {self.high:z.1f}]"


def equivalence(a: np.ndarray, b: np.ndarray, margin: float) -> Equivalence:
    """Test that `(n,)` and `(m,)` are shifted against each other by less than a margin.

    Two one-sided Mann-Whitney tests of samples moved towards each other by the margin;
    p is the larger of theirs. They are asymptotic, with tie and continuity correction.
    Both assume that distributions differ by a shift at most: where spreads differ, p is
    of the median of all differences.

    Source: Schuirmann 1987 for the two tests; Hodges and Lehmann 1963, and Lehmann's
    Nonparametrics (1975), section 2.6, for shift and interval.

    Raises:
        ValueError: if the margin is not above 0.
    """
    from scipy import stats

    a, b = checked_sample(a), checked_sample(b)
    if not (math.isfinite(margin) and margin > 0):
        raise ValueError(f"expected a margin above 0, got {margin}")
    above = stats.mannwhitneyu(a + margin, b, alternative="greater", method=METHOD)
    below = stats.mannwhitneyu(a - margin, b, alternative="less", method=METHOD)
    differences = np.sort(np.subtract.outer(a, b), axis=None)
    n, m = a.size, b.size
    deviation = math.sqrt(n * m * (n + m + 1) / 12)
    outside = n * m / 2 - stats.norm.ppf(0.5 + SHIFT_CONFIDENCE / 2) * deviation
    # number of differences beyond each bound
    k = max(0, math.floor(outside))
    return Equivalence(
        shift=float(np.median(differences)),
        low=float(differences[k]),
        high=float(differences[-1 - k]),
        margin=margin,
        p=float(max(above.pvalue, below.pvalue)),
    )


METHOD = "asymptotic"
"""Of the one-sided tests: exact ones do not allow the ties that repeated runs have."""
