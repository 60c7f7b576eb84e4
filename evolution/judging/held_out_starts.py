"""Held-out starts: those on which champions are chosen, and those of their tests.

Both sets are fixed, the same for all runs, spread evenly over the arena, and never used
in evolution.
"""

from typing import TYPE_CHECKING

import numpy as np

from epuck_mj.step.conditions import Conditions
from epuck_mj.step.disturbances import Disturbances
from evolution.settings.config_fields import N_TEST, N_VALIDATION
from evolution.settings.randomness import Purpose, disturbances, random_generator

if TYPE_CHECKING:
    from epuck_mj.scene.starts import FreeSpace

HELD_OUT_SEED = 0
"""Seed of validation and test starts, whose streams no run uses."""


def starts_for_validation(space: "FreeSpace", n: int = N_VALIDATION) -> np.ndarray:
    """The first `n` of the starts on which champions are chosen, `(n, 3)`."""
    return space.spread(random_generator(HELD_OUT_SEED, Purpose.VALIDATION), n)


def starts_for_test(space: "FreeSpace", n: int = N_TEST) -> np.ndarray:
    """The first `n` of the starts on which champions are tested, `(n, 3)`."""
    return space.spread(random_generator(HELD_OUT_SEED, Purpose.TEST), n)


def held_out_disturbances(
    conditions: Conditions, purpose: Purpose, n: int, steps: int
) -> Disturbances | None:
    """Disturbances of champions in `n` held-out trials of `steps` control steps.

    The first trials have the same disturbances for every `n` up to the default number
    of starts; for a larger `n`, all of them have others.
    """
    least = N_VALIDATION if purpose == Purpose.VALIDATION else N_TEST
    drawn = disturbances(conditions, max(n, least), steps, HELD_OUT_SEED, purpose)
    return None if drawn is None else drawn[:n]
