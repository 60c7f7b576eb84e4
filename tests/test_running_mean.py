"""Running means against plain ones, and infinite fitness."""

import numpy as np
import pytest

from evolution.search.running_mean import running_mean


def test_one_after_the_other_it_is_the_mean():
    told = np.random.default_rng(0).uniform(-300, 300, size=(20, 4))
    mean = told[0]
    for count in range(1, 20):
        mean = running_mean(mean, np.full(4, count), told[count])
        np.testing.assert_allclose(mean, told[: count + 1].mean(axis=0), rtol=1e-12)


def test_of_equals_it_is_exactly_these():
    told = np.random.default_rng(0).uniform(-300, 300, size=50)
    mean = told
    for count in range(1, 30):
        mean = running_mean(mean, np.full(50, count), told)
    assert mean.tolist() == told.tolist()


@pytest.mark.parametrize(
    ("mean", "told", "expected"),
    [
        (-np.inf, 5.0, -np.inf),
        (5.0, -np.inf, -np.inf),
        (-np.inf, -np.inf, -np.inf),
        (np.inf, 5.0, np.inf),
        (5.0, np.inf, np.inf),
        (np.inf, -np.inf, -np.inf),
    ],
)
def test_infinite_fitness_stays(mean, told, expected):
    one = running_mean(np.array([mean]), np.array([3]), np.array([told]))
    assert one.tolist() == [expected]
