"""Actions to wheel speeds."""

import numpy as np
import pytest

from epuck_mj.constants import SPEED_MAX, TRACK, WHEEL_RADIUS, WHEEL_SPEED_MAX
from epuck_mj.step.motors import STEP_ANGLE, Speeds, actual_rates, command, step_rates


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


def test_commands_in_whole_steps():
    command = np.array([[0.0, WHEEL_SPEED_MAX], [-WHEEL_SPEED_MAX, 0.0031], [9, -9]])
    rates = step_rates(command)
    assert rates.dtype == int
    np.testing.assert_array_equal(rates, [[0, 1000], [-1000, 0], [1000, -1000]])
    # half a step is the most that rounding changes
    speeds = np.linspace(-WHEEL_SPEED_MAX, WHEEL_SPEED_MAX, 999)
    error = step_rates(speeds) * STEP_ANGLE - speeds
    assert np.abs(error).max() <= STEP_ANGLE / 2 + 1e-12


def test_real_rates_of_the_datasheet():
    told = np.array([300, 350, 450, 501, 526, 527, 600, 650, 700, 750, 800, 850, 910])
    real = [303, 357, 455, 526, 526, 556, 625, 667, 714, 769, 833, 909, 1000]
    np.testing.assert_allclose(actual_rates(told), real, atol=0.5)
    np.testing.assert_allclose(actual_rates(-told), -actual_rates(told))
    assert actual_rates(np.array(0)) == 0
    every = np.arange(1, 1001)
    assert (actual_rates(every) >= every).all()
    assert (actual_rates(every, 50_000) <= 1.02 * every).all()
