"""Colours of Okabe and Ito, which colour-blind people can tell apart."""

import numpy as np

GREY, FAINT = (150, 150, 150), (180, 180, 180)
ORANGE, SKY, GREEN = (230, 159, 0), (86, 180, 233), (0, 158, 115)
YELLOW, BLUE, VERMILION = (240, 228, 66), (0, 114, 178), (213, 94, 0)
PURPLE = (204, 121, 167)

TRIALS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, YELLOW)
"""Colours that tell trials in one picture apart, in their order."""

LOW_FITNESS, HIGH_FITNESS = YELLOW, BLUE
"""Colours of a path, from step fitness 0 to 1."""


def fraction(rgb: tuple[int, int, int]) -> tuple[float, float, float]:
    """A colour for matplotlib, with components in [0, 1]."""
    red, green, blue = rgb
    return red / 255, green / 255, blue / 255


def blend(low: tuple, high: tuple, share: np.ndarray) -> np.ndarray:
    """Colours `(n, 3)` from `low` at 0 to `high` at 1, for `share` `(n,)`.

    A share beyond these, as a step fitness of one's own may have, gets the nearer one.
    """
    share = np.clip(np.nan_to_num(share), 0.0, 1.0)
    mixed = np.array(low) + share[:, None] * (np.array(high) - low)
    return np.round(mixed).astype(np.uint8)
