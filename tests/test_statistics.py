"""Statistics of runs: worked by hand, against scipy, and by simulation."""

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evolution.statistics.effect_sizes import a12, a12_interval, median_difference
from evolution.statistics.estimates import (
    Interval,
    mean_interval,
    quartiles,
    wilson,
    worst_share_mean,
)
from evolution.statistics.significance import EXACT, fisher, holm, mann_whitney, stars
from evolution.statistics.targets import (
    ecdf,
    evaluations_to_target,
    expected_running_time,
    expected_running_time_interval,
    mean_best_so_far,
)

SAMPLES = st.lists(st.integers(-5, 5), min_size=1, max_size=12).map(np.array)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


# tests


def test_mann_whitney_worked_by_hand():
    # all 20 orders of 3 and 3 are as likely; 2 of them separate the samples
    result = mann_whitney(np.array([4, 5, 6]), np.array([1, 2, 3]))
    assert (result.u, result.method) == (9, "exact")
    assert result.p == pytest.approx(2 / 20)


@pytest.mark.parametrize(
    ("n", "m", "ties", "exact"),
    [
        (10, 20, False, True),
        (EXACT, EXACT, False, True),
        (EXACT, EXACT + 1, False, False),
        (10, 20, True, False),
    ],
)
def test_mann_whitney_is_exact_for_few_values_without_ties(n, m, ties, exact):
    a, b = rng().normal(0.5, size=n), rng(1).normal(size=m)
    if ties:
        a, b = a.round(1), b.round(1)
    result = mann_whitney(a, b)
    method = "exact" if exact else "asymptotic"
    expected = stats.mannwhitneyu(a, b, method=method)
    assert result.method == method
    assert (result.u, result.p) == (expected.statistic, expected.pvalue)
    assert result.u == pytest.approx(n * m * a12(a, b))


def test_equal_values_do_not_differ():
    assert mann_whitney(np.ones(5), np.ones(7)).p == 1


def test_holm_worked_by_hand():
    # sorted .01 .02 .03 .04, times 4 3 2 1 is .04 .06 .06 .04
    adjusted = holm(np.array([0.04, 0.01, 0.03, 0.02]))
    np.testing.assert_allclose(adjusted, [0.06, 0.04, 0.06, 0.06])
    np.testing.assert_array_equal(holm(np.array([0.7, 0.6])), [1, 1])


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8).map(np.array))
def test_holm_raises_p_values_and_keeps_their_order(p):
    adjusted = holm(p)
    assert (adjusted >= p).all()
    assert (adjusted <= np.minimum(1, p.size * p)).all()
    assert (np.diff(adjusted[np.argsort(p)]) >= 0).all()
    # the most significant as by Bonferroni
    assert adjusted.min() == min(1, p.size * p.min())


@pytest.mark.slow
def test_holm_keeps_the_family_wise_error():
    """Three algorithms that do not differ, each against each: at most 5 % err."""
    # values, then pairs, of 2,000 studies with 20 runs each
    runs = rng().normal(size=(2000, 3, 20))
    pairs = [(0, 1), (0, 2), (1, 2)]
    p = np.column_stack(
        [
            # all studies at once, exact as ours is
            stats.mannwhitneyu(runs[:, i], runs[:, j], axis=1, method="exact").pvalue
            for i, j in pairs
        ]
    )
    ours = [[mann_whitney(each[i], each[j]).p for i, j in pairs] for each in runs[:50]]
    np.testing.assert_allclose(p[:50], ours, rtol=1e-12)
    errors = [(holm(row) < 0.05).any() for row in p]
    raw = (p < 0.05).any(axis=1)
    # the standard error of 5 % is 0.49 %
    assert np.mean(errors) < 0.05 + 2 * 0.0049
    assert raw.mean() > 0.08


@pytest.mark.parametrize(
    ("p", "n", "expected"),
    [
        (0.05, 10, ""),
        (0.049, 10, "*"),
        (0.01, 30, "*"),
        (0.0099, 30, "**"),
        (0.0009, 30, "***"),
        (0.0009, 9, ""),
        (math.nan, 30, ""),
    ],
)
def test_stars(p, n, expected):
    assert stars(p, n) == expected


def test_fisher_worked_by_hand():
    # 3 of 3 against 0 of 3: two of the 20 ways to draw three of six
    assert fisher(3, 3, 0, 3) == pytest.approx(0.1)
    assert fisher(12, 30, 12, 30) == 1


# effect sizes


def test_a12_worked_by_hand():
    # of six pairs three are won, one is tied
    assert a12(np.array([2, 3]), np.array([1, 2, 5])) == 3.5 / 6


@given(SAMPLES, SAMPLES)
def test_a12_against_a_slow_loop(a, b):
    wins = sum((x > y) + 0.5 * (x == y) for x in a for y in b)
    assert a12(a, b) == pytest.approx(wins / (a.size * b.size))
    assert a12(a, b) == pytest.approx(1 - a12(b, a))


def test_a12_of_a_batch():
    a, b = rng().normal(size=(4, 1, 10)), rng(1).normal(size=(3, 7))
    expected = [[a12(x[0], y) for y in b] for x in a]
    np.testing.assert_array_equal(a12(a, b), expected)


KNOWN_INTERVALS: dict[tuple[int, int, float], Interval] = {}
"""Intervals by both numbers of runs and A12."""


def covered(draw, true: float, n: int, m: int) -> float:
    """Share of 4,000 studies in which the interval holds the true A12."""
    a, b = draw((4000, n), (4000, m), true, rng(n + m))
    parts = zip(np.split(a, 4), np.split(b, 4), strict=True)
    values = np.concatenate([a12(*part) for part in parts])
    # bounds depend on the value and the numbers of runs alone
    _, first, study = np.unique(values, return_index=True, return_inverse=True)
    intervals = []
    for i in first.tolist():
        key = n, m, float(values[i])
        if key not in KNOWN_INTERVALS:
            KNOWN_INTERVALS[key] = a12_interval(a[i], b[i])
        intervals.append(KNOWN_INTERVALS[key])
    hit = np.array([each.low <= true <= each.high for each in intervals])
    return float(hit[study].mean())


def normal(a, b, true, rng):
    shift = math.sqrt(2) * stats.norm.ppf(true)
    return rng.normal(shift, 1, a), rng.normal(0, 1, b)


def skewed(a, b, true, rng):
    return rng.exponential(true / (1 - true), a), rng.exponential(1, b)


@pytest.mark.slow
@pytest.mark.parametrize("true", [0.5, 0.64, 0.71, 0.86, 0.95])
@pytest.mark.parametrize("draw", [normal, skewed])
@pytest.mark.parametrize(
    ("n", "m"), [(10, 10), (20, 20), (30, 30), (20, 30), (30, 20), (20, 10)]
)
def test_a12_intervals_hold_the_truth(draw, true, n, m):
    # the standard error is 0.3 %; towards 1 the steps of A12 are coarse
    most = 0.97 if true < 0.8 else 0.98
    assert 0.93 <= covered(draw, true, n, m) <= most


def test_separated_samples_have_a_one_sided_bound():
    above, below = np.arange(10, 20), np.arange(10)
    interval = a12_interval(above, below)
    assert (interval.value, interval.high) == (1, 1)
    assert 0.6 < interval.low < 0.9
    mirrored = a12_interval(below, above)
    assert (mirrored.value, mirrored.low) == (0, 0)
    assert mirrored.high == pytest.approx(1 - interval.low)
    more = a12_interval(np.arange(30, 60), np.arange(30))
    assert interval.low < more.low < 1


@given(SAMPLES, SAMPLES)
def test_a12_intervals_are_mirrored_and_inside(a, b):
    interval, mirrored = a12_interval(a, b), a12_interval(b, a)
    assert 0 <= interval.low <= interval.value <= interval.high <= 1
    assert interval.low < interval.high
    assert interval.low == pytest.approx(1 - mirrored.high, abs=1e-9)


def test_median_difference():
    a, b = rng().normal(3, 1, 30), rng(1).normal(0, 1, 20)
    interval = median_difference(a, b, rng())
    assert interval.value == np.median(a) - np.median(b)
    assert interval.low < interval.value < interval.high
    # drawn again in a loop; 1 % of the resamples is 0.02
    draws, generator = [], rng(2)
    for _ in range(4000):
        x, y = generator.choice(a, a.size), generator.choice(b, b.size)
        draws.append(np.median(x) - np.median(y))
    low, high = np.quantile(draws, [0.025, 0.975])
    assert interval.low == pytest.approx(low, abs=0.1)
    assert interval.high == pytest.approx(high, abs=0.1)
    assert interval == median_difference(a, b, rng())


@pytest.mark.slow
@pytest.mark.parametrize("n", [5, 10, 30])
@pytest.mark.parametrize("skew", [False, True])
def test_intervals_of_median_differences_hold_the_truth(n, skew):
    generator = rng(n)
    draw = generator.exponential if skew else generator.normal
    truth, hits = math.log(2) if skew else 0.0, 0
    n_studies = 200
    for _ in range(n_studies):
        # the medians differ by two
        a, b = 2 + draw(size=n) - truth, draw(size=n) - truth
        interval = median_difference(a, b, generator)
        hits += interval.low <= 2 <= interval.high
    # the standard error of 95 % is 1.5 %
    assert 0.91 <= hits / n_studies <= 0.99


def test_few_runs_have_no_interval():
    interval = median_difference(np.arange(4.0), np.arange(9.0), rng())
    assert math.isnan(interval.low) and math.isnan(interval.high)


# means, shares, quartiles


def test_mean_interval_holds_the_truth():
    held = 0
    for seed in range(200):
        interval = mean_interval(rng(seed).normal(5, 2, 30), rng(seed + 1000))
        held += interval.low <= 5 <= interval.high
    # the bootstrap is a little too sure of 30 values; the standard error is 1.5 %
    assert 0.89 <= held / 200 <= 0.98


def test_mean_interval_of_many_trials_is_that_of_the_normal_distribution():
    sample = rng().normal(5, 2, 1000)
    start = time.process_time()
    interval = mean_interval(sample, rng())
    assert time.process_time() - start < 0.5
    assert interval.value == sample.mean()
    margin = 1.96 * sample.std(ddof=1) / math.sqrt(1000)
    assert interval.low == pytest.approx(interval.value - margin, abs=0.15 * margin)
    assert interval.high == pytest.approx(interval.value + margin, abs=0.15 * margin)
    assert interval == mean_interval(sample, rng())


def test_a_constant_sample_has_a_mean_without_doubt():
    assert mean_interval(np.full(5, 3.0), rng()) == Interval(3, 3, 3)


@given(st.lists(st.integers(0, 3), min_size=2, max_size=6).map(np.array))
def test_small_samples_with_ties_have_bounds(sample):
    interval = mean_interval(sample, rng())
    assert sample.min() <= interval.low <= interval.value + 1e-12
    assert interval.value - 1e-12 <= interval.high <= sample.max()


def test_wilson():
    # 1.96^2 / (10 + 1.96^2)
    assert wilson(0, 10).low == 0
    assert wilson(0, 10).high == pytest.approx(0.2775, abs=1e-4)
    assert wilson(10, 10).high == 1
    interval = wilson(12, 30)
    # (p + z^2 / 2n -+ z sqrt(p q / n + z^2 / 4n^2)) / (1 + z^2 / n)
    assert interval.value == 0.4
    assert interval.low == pytest.approx(0.2459, abs=1e-4)
    assert interval.high == pytest.approx(0.5768, abs=1e-4)


def test_worst_share_mean_worked_by_hand():
    sample = np.arange(100.0)[::-1]
    assert worst_share_mean(sample) == 2  # 0 to 4
    assert worst_share_mean(sample, 0.07) == 3  # 0 to 6
    assert worst_share_mean(sample[:30]) == 70.5  # two of 30
    assert worst_share_mean(sample, 1) == sample.mean()
    assert worst_share_mean(np.array([4, 2, 3])) == 2


def test_quartiles_worked_by_hand():
    result = quartiles(np.array([5, 1, 2, 4, 3]))
    assert (result.lower, result.median, result.upper) == (2, 3, 4)


# targets


def test_mean_best_so_far_worked_by_hand():
    evaluations, best = np.array([10, 20, 40]), np.array([3.0, 1.0, 8.0])
    # nothing for 10, 3 for 30; what comes last had no time
    assert mean_best_so_far(evaluations, best) == (0 * 10 + 3 * 30) / 40
    # whoever is earlier has more
    assert mean_best_so_far(evaluations, best[::-1]) == 8 * 30 / 40
    # generations without a rise may be left out
    assert mean_best_so_far(evaluations[[0, 2]], best[[0, 2]]) == 90 / 40
    with pytest.raises(ValueError, match="as many evaluations"):
        mean_best_so_far(evaluations, best[:2])


def test_evaluations_to_target_worked_by_hand():
    evaluations, best = np.array([20, 40, 60, 80]), np.array([1.0, 3.0, 2.0, 4.0])
    assert evaluations_to_target(evaluations, best, 0) == 20
    assert evaluations_to_target(evaluations, best, 3) == 40
    # what was reached stays reached
    assert evaluations_to_target(evaluations, best, 2) == 40
    assert evaluations_to_target(evaluations, best, 3.5) == 80
    assert math.isnan(evaluations_to_target(evaluations, best, 4.1))


HITS, SPENT = np.array([100, math.nan, 300, math.nan]), np.full(4, 1000)


def test_expected_running_time_worked_by_hand():
    # 100 + 1000 + 300 + 1000 evaluations for two successes
    assert expected_running_time(HITS, SPENT) == 1200
    assert expected_running_time(HITS[1::2], SPENT[1::2]) == math.inf
    assert expected_running_time(HITS[::2], SPENT[::2]) == 200


def test_expected_running_time_is_that_of_restarts():
    """One of four hits, after 50 evaluations; the others cost 100 each."""
    hits = np.where(rng().random(20_000) < 0.25, 50.0, math.nan)
    time = expected_running_time(hits, np.full(20_000, 100))
    assert time == pytest.approx(350, rel=0.05)


def test_expected_running_time_interval():
    hits = np.where(np.arange(30) < 20, 100.0 + np.arange(30), math.nan)
    spent = np.full(30, 1000)
    interval = expected_running_time_interval(hits, spent, rng())
    assert interval.value == expected_running_time(hits, spent)
    assert 300 < interval.low < interval.value < interval.high < 1500
    assert interval == expected_running_time_interval(hits, spent, rng())
    # a third of the resamples of one hit in five have none
    once = np.array([100, math.nan, math.nan, math.nan, math.nan])
    few = expected_running_time_interval(once, np.full(5, 1000), rng())
    assert few.value == 4100
    assert few.low < 4100
    assert few.high == math.inf
    none = expected_running_time_interval(np.full(5, math.nan), np.full(5, 9), rng())
    assert none == Interval(math.inf, math.inf, math.inf)


def test_ecdf_worked_by_hand():
    hits = np.array([[100, 300], [200, math.nan]])
    budgets = np.array([99, 100, 250, 300, math.inf])
    np.testing.assert_array_equal(ecdf(hits, budgets), [0, 0.25, 0.5, 0.75, 0.75])


@given(SAMPLES, SAMPLES)
def test_ecdf_against_a_slow_loop(hits, budgets):
    hits = np.where(hits < 0, math.nan, hits)
    expected = [sum(hit <= budget for hit in hits) / hits.size for budget in budgets]
    np.testing.assert_allclose(ecdf(hits, budgets), expected)


# bad and single samples

GOOD = np.arange(5.0)


@pytest.mark.parametrize(
    "bad", [np.array([]), np.array([1, math.nan]), np.array([math.inf]), np.eye(2)]
)
@pytest.mark.parametrize(
    "function",
    [
        lambda x: mann_whitney(GOOD, x),
        lambda x: mann_whitney(x, GOOD),
        holm,
        lambda x: a12_interval(x, GOOD),
        lambda x: a12_interval(GOOD, x),
        lambda x: median_difference(x, GOOD, rng()),
        lambda x: mean_interval(x, rng()),
        worst_share_mean,
        quartiles,
        lambda x: evaluations_to_target(GOOD, x, 1),
        lambda x: expected_running_time(x, x),
    ],
)
def test_bad_samples_are_refused(function, bad):
    with pytest.raises(ValueError, match="expected") as error:
        function(bad)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "call",
    [
        lambda: holm(np.array([0.5, 1.1])),
        lambda: a12(np.array([]), GOOD),
        lambda: a12(GOOD, np.array([math.nan])),
        lambda: wilson(1, 0),
        lambda: wilson(4, 3),
        lambda: fisher(-1, 3, 1, 3),
        lambda: worst_share_mean(GOOD, 0),
        lambda: evaluations_to_target(GOOD, GOOD[:3], 1),
        lambda: expected_running_time(GOOD, GOOD[:3]),
        lambda: expected_running_time(GOOD + 1, GOOD),
        lambda: ecdf(np.array([]), GOOD),
        lambda: ecdf(GOOD, np.array([math.nan])),
    ],
)
def test_bad_arguments_are_refused(call):
    with pytest.raises(ValueError, match="expected"):
        call()


@pytest.mark.parametrize("n", [1, 2, 4, 5])
def test_few_runs_have_a_value_and_no_bounds(n):
    few = np.linspace(2, 4, n) if n > 1 else np.array([3.0])
    for interval in (
        median_difference(few, np.zeros(5), rng()),
        expected_running_time_interval(few, np.full(n, 9.0), rng()),
    ):
        assert interval.value == 3
        assert math.isnan(interval.low) == math.isnan(interval.high) == (n < 5)


def test_one_run_has_no_spread_and_differs_from_nothing():
    interval = mean_interval(np.array([3.0]), rng())
    assert interval.value == 3
    assert math.isnan(interval.low)
    assert math.isnan(interval.high)
    assert mann_whitney(np.array([3.0]), GOOD + 0.5).p == 1
