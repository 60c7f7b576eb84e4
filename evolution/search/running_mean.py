"""Running mean of fitness over evaluations, where fitness may be infinite."""

import numpy as np


def running_mean(mean: np.ndarray, count: np.ndarray, told: np.ndarray) -> np.ndarray:
    """Means `(n,)` of one evaluation more; exactly `told` where all were the same.

    One that was -inf makes the mean -inf, otherwise one that was inf makes it inf.

    Args:
        mean: of the evaluations so far, `(n,)`.
        count: how many these were, `(n,)`.
        told: the new ones, `(n,)` without NaN.
    """
    finite = np.isfinite(mean) & np.isfinite(told)
    step = np.where(finite, told, 0) - np.where(finite, mean, 0)
    infinite = np.where(np.minimum(mean, told) == -np.inf, -np.inf, np.inf)
    return np.where(finite, mean + step / (count + 1), infinite)
