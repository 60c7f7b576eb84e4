"""Actions to wheel speeds."""

import numpy as np
import pytest

from epuck_mj.constants import SPEED_MAX, TRACK, WHEEL_RADIUS, WHEEL_SPEED_MAX
from epuck_mj.motors import Speeds, command


@pytest.mark.parametrize(
    ("action", "expected"),
    [
        ((1, 0), (1, 1)),
        ((0, 0), (0, 0)),
        ((0.5, 0), (0.5, 0.5)),
        # w > 0 turns right: the left wheel is the faster
        ((0, 1), (1, -1)),
        ((0, -1), (-1, 1)),
        ((0.5, 0.25), (0.75, 0.25)),
        # saturated one by one, as the firmware does
        ((1, 1), (1, 0)),
        ((1, -0.5), (0.5, 1)),
    ],
)
def test_full_speeds(action, expected):
    wheels = command(np.array(action, float), Speeds())
    np.testing.assert_allclose(wheels / WHEEL_SPEED_MAX, expected, atol=1e-12)


def test_other_speeds_in_si_units():
    speeds = Speeds(forward=SPEED_MAX / 2, turn=1.5)
    left, right = command(np.array([0.8, 0.3]), speeds)
    forward = (left + right) / 2 * WHEEL_RADIUS
    yaw_rate = (right - left) * WHEEL_RADIUS / TRACK
    assert forward == pytest.approx(0.8 * SPEED_MAX / 2)
    assert yaw_rate == pytest.approx(-0.3 * 1.5)


def test_any_batch_shape():
    actions = np.random.default_rng(0).uniform([0, -1], [1, 1], (4, 3, 2))
    wheels = command(actions, Speeds())
    for index in np.ndindex(4, 3):
        alone = command(actions[index], Speeds())
        np.testing.assert_array_equal(wheels[index], alone)
    assert np.abs(wheels).max() <= WHEEL_SPEED_MAX
