"""Histories of runs against targets: how many evaluations a fitness costs.

A hit is the number of evaluations after which a run first reached its target, nan if it
never did.
"""

import math

import numpy as np

from evolution.statistics.estimates import (
    CONFIDENCE,
    FEWEST_FOR_INTERVAL,
    RESAMPLES,
    Interval,
    checked_sample,
)


def evaluations_to_target(
    evaluations: np.ndarray, best: np.ndarray, target: float
) -> float:
    """Evaluations until the best so far reaches `target`, nan if it never does.

    Args:
        evaluations: spent after each generation, `(generations,)`, increasing.
        best: best fitness of each generation, `(generations,)`; it may fall again.
        target: fitness to reach.

    Raises:
        ValueError: if a history is empty, not finite or its parts differ in length.
    """
    evaluations, best = _checked_history(evaluations, best)
    reached = best >= target
    return float(evaluations[reached.argmax()]) if reached.any() else math.nan


def _checked_history(
    evaluations: np.ndarray, best: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    evaluations, best = checked_sample(evaluations), checked_sample(best)
    if evaluations.size != best.size:
        raise ValueError(
            f"expected as many evaluations as best fitnesses,"
            f" got {evaluations.size} and {best.size}"
        )
    return evaluations, best


def mean_best_so_far(evaluations: np.ndarray, best: np.ndarray) -> float:
    """Mean over the evaluations of a run of its best fitness so far.

    The area under the curve of the best so far, divided by the evaluations. Before the
    first generation, it is 0.

    Args:
        evaluations: spent after each generation, `(generations,)`, increasing.
        best: best fitness of each generation, `(generations,)`; it may fall again.

    Raises:
        ValueError: if a history is empty, not finite or its parts differ in length.
    """
    evaluations, best = _checked_history(evaluations, best)
    # what a generation reached holds until the next one
    lasted = np.diff(evaluations)
    so_far = np.maximum.accumulate(best)[:-1]
    return float((so_far * lasted).sum() / evaluations[-1])


def expected_running_time(hits: np.ndarray, spent: np.ndarray) -> float:
    """Evaluations per success if failed runs start again; inf without a success.

    The evaluations of all runs, each up to its hit or to its end without one, divided
    by the number of runs that hit.

    Args:
        hits: evaluations to the target, `(runs,)`, nan if never.
        spent: evaluations of the whole run, `(runs,)`.

    Source: Auger and Hansen 2005, "Performance evaluation of an advanced local search
    evolutionary algorithm"; Hansen et al. 2021, "COCO", section 4.

    Raises:
        ValueError: if there are no runs or the lengths differ.
    """
    cost, hit = _cost(hits, spent)
    return float(cost.sum() / hit.sum()) if hit.any() else math.inf


def expected_running_time_interval(
    hits: np.ndarray, spent: np.ndarray, rng: np.random.Generator
) -> Interval:
    """The expected running time with a percentile bootstrap over runs.

    A resample without a success takes forever, so the upper bound is inf where few
    runs hit. The bounds are nan below 5 runs, and inf if none hit.
    """
    cost, hit = _cost(hits, spent)
    value = expected_running_time(hits, spent)
    if hit.size < FEWEST_FOR_INTERVAL:
        return Interval(value, math.nan, math.nan)
    drawn = rng.integers(hit.size, size=(RESAMPLES, hit.size))
    total, successes = cost[drawn].sum(axis=-1), hit[drawn].sum(axis=-1)
    times = np.full(RESAMPLES, math.inf)
    np.divide(total, successes, out=times, where=successes > 0)
    # inf has no neighbours to interpolate between
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(times, [tail, 1 - tail], method="inverted_cdf")
    return Interval(value, float(low), float(high))


def ecdf(hits: np.ndarray, budgets: np.ndarray) -> np.ndarray:
    """Share of the targets reached within each number of evaluations, `(budgets,)`.

    Args:
        hits: of any number of runs and targets, `(...)`, nan if never reached.
        budgets: numbers of evaluations, `(budgets,)`.

    Source: Hansen et al. 2021, "COCO: a platform for comparing continuous optimizers".

    Raises:
        ValueError: if there are no hits or a budget is nan.
    """
    hits, budgets = np.asarray(hits, float), np.asarray(budgets, float)
    if not hits.size:
        raise ValueError("expected at least one run and target, got none")
    if np.isnan(budgets).any():
        raise ValueError("expected numbers of evaluations, got nan")
    # nan sorts last, as what is never reached should
    in_order = np.sort(hits, axis=None)
    within = np.searchsorted(in_order[~np.isnan(in_order)], budgets, side="right")
    return within / hits.size


def _cost(hits: np.ndarray, spent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluations that each run used `(runs,)`, and whether it reached the target."""
    hits, spent = np.asarray(hits, float), checked_sample(spent)
    if hits.shape != spent.shape:
        raise ValueError(
            f"expected a hit or nan for each of {spent.size} runs, got {hits.shape}"
        )
    hit = ~np.isnan(hits)
    if (hits[hit] > spent[hit]).any():
        raise ValueError("expected no hit after the end of its run")
    return np.where(hit, hits, spent), hit
