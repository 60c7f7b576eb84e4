"""Equivalence: two one-sided tests, by hand, against scipy and by simulation."""

import numpy as np
import pytest
from scipy import stats

from evolution.statistics.equivalence import equivalence
from evolution.statistics.significance import mann_whitney

MARGIN = 10.0

EARLIER = {
    "de-best": [
        *(225.9, 204.9, 219.0, 192.3, 222.9, 205.2, 219.5, 217.7, 200.1, 226.5),
        *(203.7, 230.5, 215.4, 238.1, 194.9, 210.9, 206.2, 190.4, 230.6, 228.7),
    ],
    "ga": [
        *(220.7, 222.7, 222.4, 213.0, 211.2, 218.5, 222.2, 209.1, 234.1, 206.0),
        *(204.5, 232.4, 211.7, 222.7, 141.9, 219.1, 217.3, 209.2, 192.3, 164.7),
    ],
}
"""Held-out fitness on wheels of the runs of an earlier study, on another simulator."""


def pool() -> np.ndarray:
    """Deviations from the median, of both."""
    return np.concatenate(
        [np.array(each) - np.median(each) for each in EARLIER.values()]
    )


def drawn(rng: np.random.Generator, n: int, shift: float):
    """Two samples whose distributions differ by a shift."""
    a, b = (rng.choice(pool(), n) + rng.normal(0, 2, n) for _ in range(2))
    return a + shift, b


def test_against_scipys_one_sided_tests():
    a, b = drawn(np.random.default_rng(0), 30, 3.0)
    found = equivalence(a, b, MARGIN)
    one_sided = [
        stats.mannwhitneyu(
            a, b + moved, alternative=alternative, method="asymptotic"
        ).pvalue
        for moved, alternative in ((-MARGIN, "greater"), (MARGIN, "less"))
    ]
    assert found.p == pytest.approx(max(one_sided))
    differences = np.subtract.outer(a, b)
    assert found.shift == np.median(differences)
    assert found.low < found.shift < found.high


def test_the_other_way_round_it_is_the_same_test():
    a, b = drawn(np.random.default_rng(1), 25, 4.0)
    there, back = equivalence(a, b, MARGIN), equivalence(b, a, MARGIN)
    assert back.p == pytest.approx(there.p)
    turned = there.turned()
    assert (back.shift, back.low, back.high) == (
        pytest.approx(turned.shift),
        pytest.approx(turned.low),
        pytest.approx(turned.high),
    )


def test_interval_and_p_say_the_same():
    """Within the margin if and only if p is below 0.05, but for rounding of ranks."""
    rng, agreed = np.random.default_rng(2), 0
    for _ in range(200):
        found = equivalence(*drawn(rng, 40, rng.uniform(-12, 12)), MARGIN)
        inside = found.low > -MARGIN and found.high < MARGIN
        agreed += inside == (found.p < 0.05)
    assert agreed >= 196


def test_small_samples_have_the_widest_interval_there_is():
    found = equivalence(np.array([1.0, 2.0]), np.array([5.0]), MARGIN)
    assert (found.low, found.shift, found.high) == (-4, -3.5, -3)
    assert found.p > 0.05


@pytest.mark.parametrize("margin", [0, -1, np.nan, np.inf])
def test_a_margin_is_above_0(margin):
    with pytest.raises(ValueError, match="expected a margin above 0"):
        equivalence(np.ones(3), np.ones(3), margin)


@pytest.mark.parametrize(
    ("n", "shift", "least", "most"),
    [
        # the errors, at the margin: 5 %, and four standard errors of 600 studies
        (30, MARGIN, 0.0, 0.086),
        (100, MARGIN, 0.0, 0.086),
        (100, -MARGIN, 0.0, 0.086),
        # the power that docs/method.md promises
        (100, 0.0, 0.95, 1.0),
        (100, 5.0, 0.75, 0.9),
        (30, 0.0, 0.6, 0.8),
    ],
)
def test_errors_and_power_by_simulation(n, shift, least, most):
    rng = np.random.default_rng(3)
    called = [equivalence(*drawn(rng, n, shift), MARGIN).p < 0.05 for _ in range(600)]
    assert least <= np.mean(called) <= most


@pytest.mark.parametrize(
    ("n", "shift", "least", "most"),
    [(100, 10.0, 0.97, 1.0), (100, 5.0, 0.6, 0.8), (30, 10.0, 0.65, 0.87)],
)
def test_power_of_the_difference_test_by_simulation(n, shift, least, most):
    rng = np.random.default_rng(4)
    called = [mann_whitney(*drawn(rng, n, shift)).p < 0.05 for _ in range(600)]
    assert least <= np.mean(called) <= most
