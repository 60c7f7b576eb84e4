"""Compiled exponential, logarithm and interpolation for one number.

The same operations in the same order as those of `step.elementary`.
"""

from math import frexp

import numpy as np

from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.step.elementary import (
    EXP_MAX,
    LN2_HIGH,
    LN2_LOW,
    N_TABLE,
    NEAREST,
    PER_LN2,
    POWERS,
    ROOTS,
    STEP_HIGH,
    STEP_LOW,
    TABLE_BITS,
)


@compiled(forceinline=True)
def exp(x):
    """See `elementary.exp`."""
    x = min(max(x, -EXP_MAX), EXP_MAX)
    k = (x * PER_LN2 + NEAREST) - NEAREST
    r = (x - k * STEP_HIGH) - k * STEP_LOW
    square = r * r
    high = 1 / 6 + r * (1 / 24 + r * (1 / 120))
    series = r + square * (0.5 + r * high)
    whole = np.int64(k)
    root = ROOTS[whole & (N_TABLE - 1)]
    return (root + root * series) * POWERS[(whole >> TABLE_BITS) + 1022]


@compiled(forceinline=True)
def half_tanh(x):
    """See `elementary.half_tanh`."""
    return 1.0 - 2.0 / (exp(x) + 1.0)


@compiled()
def log(x):
    """See `elementary.log`."""
    mantissa, whole = frexp(x)
    exponent = float(whole)
    if mantissa < 0.7071067811865476:
        mantissa, exponent = 2 * mantissa, exponent - 1
    s = (mantissa - 1) / (mantissa + 1)
    z = s * s
    series = 0.0
    for power in range(21, 2, -2):
        series = z * (1 / power + series)
    return exponent * LN2_HIGH + (2 * s * series + (exponent * LN2_LOW + 2 * s))


@compiled(forceinline=True)
def interpolate(x, xs, ys):
    """See `elementary.interpolate`."""
    n = xs.shape[0]
    x = min(max(x, xs[0]), xs[n - 1])
    i = 0
    while i < n - 2 and xs[i + 1] <= x:
        i += 1
    slope = (ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i])
    return ys[i] + (x - xs[i]) * slope
