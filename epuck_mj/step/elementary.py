"""Exponential and logarithm with the same bits on every processor.

Sums, products and quotients of IEEE doubles are the same everywhere; numpy's `exp`,
`log` and `tanh` are not, since each processor has its own. Here they are tables and
polynomials. `rungs.kinematic.elementary` has the same operations in the same order for
one number.

Source: reduction as in fdlibm (e_exp.c, e_log.c); series of exp and of artanh.
"""

import numpy as np

TABLE_BITS = 6
N_TABLE = 1 << TABLE_BITS

EXP_MAX = 700.0
"""Arguments of `exp` are cut to plus and minus this; e^710 would overflow."""

PER_LN2 = N_TABLE * 1.4426950408889634
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
STEP_HIGH, STEP_LOW = LN2_HIGH / N_TABLE, LN2_LOW / N_TABLE
"""ln 2 / 64 in two parts: products of the first with whole numbers are exact."""

NEAREST = 1.5 * 2.0**52
"""Adding and subtracting this rounds to the nearest whole number."""

POWERS = np.array([float.fromhex(f"0x1p{k}") for k in range(-1022, 1023)])
"""Powers of two; 2^k is `POWERS[k + 1022]`."""


def _roots() -> np.ndarray:
    """2^(j / 64), each the double nearest to it: integer square roots are exact."""
    from math import isqrt

    values = []
    for j in range(N_TABLE):
        # 2^(j/64) = sqrt applied six times to 2^j, in fixed point of 200 bits
        value = 1 << (j + 200)
        for _ in range(TABLE_BITS):
            value = isqrt(value << 200)
        values.append(value / (1 << 200))
    return np.array(values)


ROOTS = _roots()


def exp(x: np.ndarray) -> np.ndarray:
    """E to the x, within two units in the last place, `(...)`."""
    x = np.minimum(np.maximum(x, -EXP_MAX), EXP_MAX)
    k = (x * PER_LN2 + NEAREST) - NEAREST
    r = (x - k * STEP_HIGH) - k * STEP_LOW
    square = r * r
    high = 1 / 6 + r * (1 / 24 + r * (1 / 120))
    series = r + square * (0.5 + r * high)
    whole = k.astype(np.int64)
    root = ROOTS[whole & (N_TABLE - 1)]
    return (root + root * series) * POWERS[(whole >> TABLE_BITS) + 1022]


def half_tanh(x: np.ndarray) -> np.ndarray:
    """tanh(x / 2) = 2 sigmoid(x) - 1, `(...)`: never overflows."""
    return 1.0 - 2.0 / (exp(x) + 1.0)


def log(x: np.ndarray) -> np.ndarray:
    """Natural logarithm of positive numbers, `(...)`."""
    mantissa, exponent = np.frexp(np.asarray(x, float))
    small = mantissa < 0.7071067811865476
    mantissa = np.where(small, 2 * mantissa, mantissa)
    exponent = np.where(small, exponent - 1, exponent).astype(float)
    s = (mantissa - 1) / (mantissa + 1)
    z = s * s
    series = np.zeros_like(z)
    for power in range(21, 2, -2):
        series = z * (1 / power + series)
    return exponent * LN2_HIGH + (2 * s * series + (exponent * LN2_LOW + 2 * s))


def interpolate(x: np.ndarray, xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
    """Values at `x` of the line through points, level before and after it, `(...)`.

    Args:
        x: where.
        xs: of the points, growing, `(n,)`.
        ys: of the points, `(n,)`.
    """
    x = np.minimum(np.maximum(x, xs[0]), xs[-1])
    i = np.clip(np.searchsorted(xs, x, side="right") - 1, 0, len(xs) - 2)
    slope = (ys[1:] - ys[:-1]) / (xs[1:] - xs[:-1])
    return ys[i] + (x - xs[i]) * slope[i]


PI_HIGH, PI_LOW = 1.5707963267341256, 6.0771005063039900e-11
"""Half of pi in two parts: products of the first with small whole numbers are exact."""


def cos_sin(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine of angles below 10^5 [rad], `(...)` both."""
    quarter = (x * (2 / np.pi) + NEAREST) - NEAREST
    r = (x - quarter * PI_HIGH) - quarter * PI_LOW
    z = r * r
    cos, sin = np.zeros_like(z), np.zeros_like(z)
    for n in range(16, 0, -2):
        cos = z * (-1 / (n * (n - 1))) * (1.0 + cos)
        sin = z * (-1 / (n * (n + 1))) * (1.0 + sin)
    cos, sin = 1.0 + cos, r + r * sin
    turns = quarter.astype(np.int64) & 3
    return (
        np.choose(turns, [cos, -sin, -cos, sin]),
        np.choose(turns, [sin, cos, -sin, -cos]),
    )
