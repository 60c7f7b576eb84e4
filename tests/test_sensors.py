"""Distances to observations."""

import numpy as np

from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.sensors import observe


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
