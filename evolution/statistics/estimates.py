"""Estimates from samples of runs: means, shares and quartiles with bounds.

The unit is the run: a sample is `(n,)`, one value per run. An empty sample and values
that are not finite raise `ValueError`. The bounds of one run, and of too few runs for a
reliable interval, are nan. The same generator gives the same bounds.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

FEWEST_FOR_INTERVAL = 5
"""Least number of runs for the interval of a comparison or a cost.

Of 3, bounds said to hold the truth in 95 % hold it in 90; of 2, in 66.
"""

FEWEST_FOR_RANKS = 5
"""Least number of pairs for a rank correlation: with 4, any order is common."""

CONFIDENCE = 0.95
"""Probability with which intervals hold the true value."""

RESAMPLES = 2000
"""Number of resamples of each bootstrap."""

BATCH = 200
"""Number of resamples in memory at once: small arrays stay in the cache."""


@dataclass(frozen=True)
class Interval:
    """An estimate and its confidence bounds.

    Attributes:
        value: the estimate itself.
        low: lower bound, nan if one run says nothing about the spread.
        high: upper bound, nan if so is the lower one.
    """

    value: float
    low: float
    high: float


def mean_interval(sample: np.ndarray, rng: np.random.Generator) -> Interval:
    """Mean of `(n,)` with a BCa bootstrap interval, of width 0 if all are equal.

    Source: Efron 1987, "Better bootstrap confidence intervals".
    """
    sample = checked_sample(sample)
    value = float(sample.mean())
    if sample.size < 2:
        return Interval(value, math.nan, math.nan)
    if np.ptp(sample) == 0:
        return Interval(value, value, value)
    low, high = bootstrap((sample,), np.mean, "BCa", rng)
    return Interval(value, low, high)


def wilson(successes: int, n: int) -> Interval:
    """Share of successes with Wilson's interval.

    Source: Wilson 1927, without continuity correction.

    Raises:
        ValueError: if there are no trials or more successes than trials.
    """
    from scipy import stats

    refuse_no_share(successes, n)
    test = stats.binomtest(successes, n)
    low, high = test.proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / n, float(low), float(high))


@dataclass(frozen=True)
class Quartiles:
    """Median and quartiles of a sample."""

    lower: float
    median: float
    upper: float


def quartiles(sample: np.ndarray) -> Quartiles:
    """Quartiles of `(n,)`, interpolated as numpy does by default."""
    return Quartiles(*np.quantile(checked_sample(sample), [0.25, 0.5, 0.75]).tolist())


def worst_share_mean(sample: np.ndarray, share: float = 0.05) -> float:
    """Mean of the lowest `share` of `(n,)`, rounded up to whole values.

    Source: conditional value at risk, Rockafellar and Uryasev 2000.

    Raises:
        ValueError: if the share is not in (0, 1].
    """
    sample = checked_sample(sample)
    if not 0 < share <= 1:
        raise ValueError(f"expected a share in (0, 1], got {share}")
    # a share such as 0.07 of 100 is a little more than 7 in floats
    n_worst = math.ceil(round(share * sample.size, 9))
    return float(np.sort(sample)[: max(n_worst, 1)].mean())


def checked_sample(sample: np.ndarray) -> np.ndarray:
    """A sample `(n,)` as floats.

    Raises:
        ValueError: if it is empty, not finite or has another shape.
    """
    sample = np.asarray(sample, float)
    if sample.ndim != 1 or not sample.size:
        raise ValueError(f"expected a sample (n,), n > 0, got shape {sample.shape}")
    if not np.isfinite(sample).all():
        n_bad = np.count_nonzero(~np.isfinite(sample))
        raise ValueError(f"expected finite values, got {n_bad} that are not")
    return sample


def refuse_no_share(successes: int, n: int) -> None:
    """Refuse numbers of successes that are impossible.

    Raises:
        ValueError: if there are no trials or more successes than trials.
    """
    if not 0 <= successes <= n or n < 1:
        raise ValueError(f"expected 0 to n successes, n > 0, got {successes} of {n}")


def bootstrap(
    samples: tuple[np.ndarray, ...],
    statistic: Callable,
    method: str,
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Bounds of a statistic over resamples of each sample.

    Args:
        samples: each `(n,)`, of at least two values.
        statistic: of arrays `(..., n)` along an `axis`, `(...)`.
        method: as scipy calls it.
        rng: draws the resamples.
    """
    from scipy import stats

    interval = stats.bootstrap(
        samples,
        statistic,
        n_resamples=RESAMPLES,
        batch=BATCH,
        vectorized=True,
        confidence_level=CONFIDENCE,
        method=method,
        rng=rng,
    ).confidence_interval
    return float(interval.low), float(interval.high)


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    """Spearman's rank correlation of `(n,)` and `(n,)`.

    None of fewer than 5 pairs, or if all values of one are equal.
    """
    if a.size < FEWEST_FOR_RANKS or np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    from scipy import stats

    result: Any = stats.spearmanr(a, b)
    return float(result.statistic)
