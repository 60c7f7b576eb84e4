"""Significance: the Mann-Whitney test, Fisher's, and Holm's adjustment of a family.

The unit is the run: samples are `(n,)` and `(m,)`, one value per run. Empty
samples and values that are not finite raise `ValueError`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from evolution.statistics.estimates import checked_sample, refuse_no_share

EXACT = 50
"""Largest sample of which the Mann-Whitney test is exact; takes milliseconds."""

FEWEST_FOR_STARS = 10
"""Least size of the smaller sample for stars."""

LEVELS = (0.05, 0.01, 0.001)
"""Values of p below which a test gets one star more."""


@dataclass(frozen=True)
class MannWhitney:
    """Outcome of a Mann-Whitney test.

    Attributes:
        u: pairs in which the first sample is greater, ties counted half.
        p: two-sided.
        method: "exact" or "asymptotic", as p is.
    """

    u: float
    p: float
    method: str


def mann_whitney(a: np.ndarray, b: np.ndarray) -> MannWhitney:
    """Two-sided Mann-Whitney test of `(n,)` against `(m,)`.

    Exact if neither sample exceeds 50 and no two values tie; else asymptotic, with tie
    and continuity correction.

    Source: Mann and Whitney 1947.
    """
    from scipy import stats

    a, b = checked_sample(a), checked_sample(b)
    together = np.concatenate([a, b])
    exact = max(a.size, b.size) <= EXACT and np.unique(together).size == together.size
    method = "exact" if exact else "asymptotic"
    u, p = stats.mannwhitneyu(a, b, alternative="two-sided", method=method)
    return MannWhitney(float(u), float(p), method)


def holm(p_values: np.ndarray) -> np.ndarray:
    """P values `(tests,)` adjusted for their number, in their order.

    Source: Holm 1979, "A simple sequentially rejective multiple test procedure".

    Raises:
        ValueError: if there are none or one is not in [0, 1].
    """
    p = checked_sample(p_values)
    if (p < 0).any() or (p > 1).any():
        raise ValueError(f"expected p values in [0, 1], got {p.min()} to {p.max()}")
    order = np.argsort(p, kind="stable")
    # the smallest counts for all tests, the next for all but one
    stepped = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def stars(p: float, n: int) -> str:
    """One star for each of .05, .01 and .001 that p is below.

    Args:
        p: adjusted for the family.
        n: size of the smaller sample; below 10 there are no stars.
    """
    return "*" * sum(p < level for level in LEVELS) if n >= FEWEST_FOR_STARS else ""


def fisher(successes_a: int, n_a: int, successes_b: int, n_b: int) -> float:
    """P value of Fisher's exact test of two shares of successes, two-sided.

    Raises:
        ValueError: if there are no trials or more successes than trials.
    """
    from scipy import stats

    refuse_no_share(successes_a, n_a)
    refuse_no_share(successes_b, n_b)
    table = [[successes_a, n_a - successes_a], [successes_b, n_b - successes_b]]
    result: Any = stats.fisher_exact(table)
    return float(result.pvalue)
