"""Exponentials, logarithms and angles: right, and the same for one number and many."""

import math

import numpy as np
import pytest

from epuck_mj.rungs.kinematic import elementary as one_number
from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.step import elementary

RNG = np.random.default_rng(0)
MANY = np.concatenate(
    [
        RNG.uniform(-50, 50, 20_000),
        RNG.uniform(-690, 690, 5_000),
        np.linspace(-1e-3, 1e-3, 2_001),
        [0.0, 700, -700, 1e4, -1e4, np.inf, -np.inf],
    ]
)


@compiled()
def each(function, values, results):
    for i in range(len(values)):
        results[i] = function(values[i])


@pytest.mark.parametrize("name", ["exp", "half_tanh", "log"])
def test_one_number_and_many_have_the_same_bits(name):
    many = MANY if name != "log" else MANY[(MANY > 0) & np.isfinite(MANY)]
    results = np.empty_like(many)
    each(getattr(one_number, name), many, results)
    np.testing.assert_array_equal(results, getattr(elementary, name)(many))


def test_exp_is_within_two_units_in_the_last_place():
    x = MANY[np.abs(MANY) < 690]
    expected = np.array([math.exp(value) for value in x])
    assert (np.abs(elementary.exp(x) - expected) <= 2 * np.spacing(expected)).all()


def test_limits_are_finite():
    assert np.isfinite(elementary.exp(MANY)).all()
    np.testing.assert_array_equal(
        elementary.half_tanh(np.array([-1e9, -0.0, 0.0, 1e9])), [-1, 0, 0, 1]
    )


def test_half_tanh():
    expected = [math.tanh(value / 2) for value in MANY]
    np.testing.assert_allclose(elementary.half_tanh(MANY), expected, atol=4e-16)


def test_log():
    x = np.concatenate(
        [10 ** RNG.uniform(-300, 300, 10_000), RNG.uniform(0.5, 2, 9000)]
    )
    expected = np.array([math.log(value) for value in x])
    np.testing.assert_allclose(elementary.log(x), expected, rtol=1e-15, atol=1e-16)


def test_cos_and_sin():
    x = np.concatenate([RNG.uniform(-10, 10, 10_000), RNG.uniform(-1e5, 1e5, 10_000)])
    cos, sin = elementary.cos_sin(x)
    # an angle's own spacing is all that is lost of large ones
    off = np.maximum(2e-16, 1e-3 * np.spacing(np.abs(x)))
    assert (np.abs(cos - [math.cos(value) for value in x]) <= off).all()
    assert (np.abs(sin - [math.sin(value) for value in x]) <= off).all()


def test_interpolation_is_numpy_s_and_the_compiled_one_is_the_same():
    xs = np.sort(RNG.uniform(0, 1, 13))
    ys = RNG.uniform(-5, 5, 13)
    x = np.concatenate([RNG.uniform(-0.5, 1.5, 2000), xs])
    expected = elementary.interpolate(x, xs, ys)
    np.testing.assert_allclose(expected, np.interp(x, xs, ys), rtol=1e-13, atol=1e-13)
    one = np.array([one_number.interpolate(value, xs, ys) for value in x])
    np.testing.assert_array_equal(one, expected)
