"""Distances to observations, and to what real sensors count."""

import itertools

import numpy as np
import pytest

from epuck_mj.constants import PROXIMITY_COUNT_MAX, PROXIMITY_COUNTS, PROXIMITY_RANGE
from epuck_mj.step.sensors import observe, proximity


def test_linear_from_contact_to_range():
    distance = np.array([0.0, 0.01, 0.02, 0.04, 0.05, 0.9, -1.0, 0.03])
    expected = [0, 0.25, 0.5, 1, 1, 1, 1, 0.75]
    np.testing.assert_allclose(observe(distance, PROXIMITY_RANGE), expected)


def test_any_batch_shape():
    distance = np.random.default_rng(0).uniform(-0.02, 0.08, (3, 5, 8))
    observation = observe(distance, PROXIMITY_RANGE)
    assert observation.shape == (3, 5, 8)
    for index in np.ndindex(3, 5):
        alone = observe(distance[index], PROXIMITY_RANGE)
        np.testing.assert_array_equal(observation[index], alone)
    assert observation.min() >= 0
    assert observation.max() <= 1


def test_the_input_is_left_alone():
    distance = np.full(8, -1.0)
    observe(distance, PROXIMITY_RANGE)
    np.testing.assert_array_equal(distance, -1.0)


KNOWN = sorted(PROXIMITY_COUNTS)
FARTHEST = KNOWN[-1]


def test_proximity_is_what_was_measured_where_it_was_measured():
    expected = [PROXIMITY_COUNTS[distance] for distance in KNOWN]
    counts = proximity(np.array(KNOWN))
    np.testing.assert_allclose(counts, expected, rtol=1e-12)
    # as whole counts, exactly
    assert np.rint(counts).tolist() == expected


def test_proximity_falls_with_distance():
    counts = proximity(np.linspace(0, FARTHEST, 10_001))
    assert (np.diff(counts) < 0).all()
    assert 0 < counts.min() < counts.max() <= PROXIMITY_COUNT_MAX
    # the logarithm is linear in between: the geometric mean is halfway
    for near, far in itertools.pairwise(KNOWN):
        mean = np.sqrt(PROXIMITY_COUNTS[near] * PROXIMITY_COUNTS[far])
        halfway = proximity(np.array((near + far) / 2))
        assert halfway == pytest.approx(mean, rel=1e-12)


def test_proximity_of_nothing_is_0():
    distance = np.array([-1.0, -1e-9, np.nextafter(FARTHEST, 1), 0.5, np.inf])
    np.testing.assert_array_equal(proximity(distance), 0)


@pytest.mark.parametrize("shape", [(8,), (1, 8), (3, 5, 8), (0, 8)])
def test_proximity_has_the_shape_of_its_input(shape):
    distance = np.random.default_rng(0).uniform(-0.02, 0.2, shape)
    before = distance.copy()
    counts = proximity(distance)
    assert (counts.shape, counts.dtype) == (shape, float)
    for index in np.ndindex(shape):
        assert counts[index] == proximity(distance[index])
    np.testing.assert_array_equal(distance, before)
