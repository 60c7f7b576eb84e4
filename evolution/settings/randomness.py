"""Randomness by purpose: independent streams of one seed."""

from enum import IntEnum

import numpy as np

from epuck_mj.step.conditions import Conditions
from epuck_mj.step.disturbances import Disturbances


class Purpose(IntEnum):
    """Purpose of a random stream; streams of different purposes are independent."""

    SEARCH = 0
    STARTS = 1
    VALIDATION = 2
    TEST = 3
    DISTURBANCES = 4
    LESSONS = 5


def random_generator(seed: int, *key: int) -> np.random.Generator:
    """The random stream of a seed, a purpose and further numbers."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def disturbances(
    conditions: Conditions, n: int, steps: int, seed: int, *key: int
) -> Disturbances | None:
    """Disturbances of `n` trials; None for ideal robots.

    Args:
        conditions: what the robots are like.
        n: number of trials.
        steps: control steps of a trial.
        seed: of all randomness.
        key: what the trials are for, and what else they depend on.
    """
    rng = random_generator(seed, Purpose.DISTURBANCES, *key)
    return conditions.draw(rng, n, steps)
