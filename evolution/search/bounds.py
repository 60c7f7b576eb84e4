"""Bounds rules: how genes outside the bounds are moved.

The paper does not say what happens to them. In its differential evolution, with CR = 1
and F = 0.8, they are common.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.random import Generator


def unbounded(
    trial: np.ndarray, parent: np.ndarray, lower: float, upper: float, rng: Generator
) -> np.ndarray:
    """Leave the trial as it is: the population may leave the bounds."""
    return trial


def midpoint(
    trial: np.ndarray, parent: np.ndarray, lower: float, upper: float, rng: Generator
) -> np.ndarray:
    """Move genes halfway between the parent and the violated bound."""
    trial = np.where(trial < lower, (parent + lower) / 2, trial)
    return np.where(trial > upper, (parent + upper) / 2, trial)


def clip(
    trial: np.ndarray, parent: np.ndarray, lower: float, upper: float, rng: Generator
) -> np.ndarray:
    """Move genes to the violated bound."""
    return np.clip(trial, lower, upper)


def reflect(
    trial: np.ndarray, parent: np.ndarray, lower: float, upper: float, rng: Generator
) -> np.ndarray:
    """Mirror genes at the bounds until they are inside."""
    # Repeated mirroring is a triangle wave of period 2 * width.
    width = upper - lower
    mirrored = lower + width - np.abs(np.mod(trial - lower, 2 * width) - width)
    inside = (trial >= lower) & (trial <= upper)
    # The sum above may round to just outside.
    return np.where(inside, trial, np.clip(mirrored, lower, upper))


def reinit(
    trial: np.ndarray, parent: np.ndarray, lower: float, upper: float, rng: Generator
) -> np.ndarray:
    """Draw genes anew, uniformly inside the bounds."""
    fresh = rng.uniform(lower, upper, size=trial.shape)
    return np.where((trial < lower) | (trial > upper), fresh, trial)


BoundsRule = Callable[[np.ndarray, np.ndarray, float, float, Generator], np.ndarray]
# (trial (..., genes), parent (..., genes), lower, upper, rng) -> trial, gene by gene
BOUNDS_RULES: Mapping[str, BoundsRule] = {
    "midpoint": midpoint,
    "none": unbounded,
    "clip": clip,
    "reflect": reflect,
    "reinit": reinit,
}


def check_bounds_rule(name: str) -> None:
    """Refuse the name of an unknown rule.

    Raises:
        ValueError: there is no rule of that name.
    """
    if name not in BOUNDS_RULES:
        available = ", ".join(BOUNDS_RULES)
        raise ValueError(f"unknown bounds rule {name!r}; available: {available}")
