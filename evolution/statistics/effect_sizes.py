"""Effect sizes: by how much the runs of two algorithms differ.

The unit is the run: samples are `(n,)` and `(m,)`, one value per run. Empty
samples and values that are not finite raise `ValueError`.
"""

import math
from collections.abc import Callable

import numpy as np

from evolution.statistics.estimates import (
    CONFIDENCE,
    FEWEST_FOR_INTERVAL,
    Interval,
    bootstrap,
    checked_sample,
)

INSIDE = 1e-12
"""Distance kept from 0 and 1 in the search for roots: a value there is one itself."""


def a12(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Probability that a draw of `(..., n)` exceeds one of `(..., m)`, ties half.

    Source: Vargha and Delaney 2000, "A critique and improvement of the CL common
    language effect size statistics of McGraw and Wong".
    """
    return _wins(a, b).mean(axis=(-1, -2))


def a12_interval(a: np.ndarray, b: np.ndarray) -> Interval:
    """A12 of `(n,)` over `(m,)` with Newcombe's score interval.

    All values of A12 that the samples do not reject, each with the variance it would
    have itself. So separated samples get a one-sided bound and not a point.

    No bootstrap, since none held its 95 % for 10 to 30 runs and A12 from 0.5 to 0.95:
    percentile covers 84 to 99 %, BCa 92 to 99 %, bootstrap-t is often unbounded. This
    covers 94 to 98 % for samples of one size that are normal or exponential, and at
    least 92 % if one has three times the spread. With 10 runs against 30 and unlike
    shapes or spreads it may be 87 to 99 %.

    Source: Newcombe 2006, "Confidence intervals for an effect size measure based on the
    Mann-Whitney statistic. Part 2", method 5.
    """
    from scipy import stats

    a, b = checked_sample(a), checked_sample(b)
    value = float(a12(a, b))
    z = float(stats.norm.ppf((1 + CONFIDENCE) / 2))
    half = (a.size + b.size) / 2 - 1

    def excess(true: float) -> float:
        """Excess of a deviation over what chance allows; positive if rejected."""
        spread = 1 + half * ((1 - true) / (2 - true) + true / (1 + true))
        variance = true * (1 - true) * spread / (a.size * b.size)
        return abs(value - true) - z * math.sqrt(variance)

    low, high = 0.0, 1.0
    if value > 0:
        low = _root(excess, 0, min(value, 1 - INSIDE))
    if value < 1:
        high = _root(excess, max(value, INSIDE), 1)
    return Interval(value, low, high)


def median_difference(
    a: np.ndarray, b: np.ndarray, rng: np.random.Generator
) -> Interval:
    """Median of `(n,)` minus median of `(m,)`, with a percentile bootstrap.

    Percentile, since a median moves in steps: BCa's jackknife fails on it. Covers 92 to
    99 % from 5 runs on; of fewer there are no bounds.
    """
    a, b = checked_sample(a), checked_sample(b)
    value = float(np.median(a) - np.median(b))
    if min(a.size, b.size) < FEWEST_FOR_INTERVAL:
        return Interval(value, math.nan, math.nan)

    def difference(a: np.ndarray, b: np.ndarray, axis: int) -> np.ndarray:
        return np.median(a, axis=axis) - np.median(b, axis=axis)

    low, high = bootstrap((a, b), difference, "percentile", rng)
    return Interval(value, low, high)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy import optimize

    return float(optimize.root_scalar(function, bracket=(low, high)).root)


def _wins(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Wins of each pair `(..., n, m)`: 1 if the first is greater, 0.5 if they tie."""
    a, b = np.asarray(a, float)[..., :, None], np.asarray(b, float)[..., None, :]
    if not (a.size and b.size and np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError(
            "expected samples of finite values, got an empty or another one"
        )
    return (a > b) + 0.5 * (a == b)
