"""Spaces of Gymnasium's environments, and checks of what they are told."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.host.limits import check, shown

LOWEST, HIGHEST = np.array([0.0, -1.0]), np.array([1.0, 1.0])
"""Bounds of actions: v (forward) and w (turn, right positive)."""


def spaces() -> tuple[Box, Box]:
    """Spaces of one observation and one action, which draw samples of their own.

    They are float64, as in evaluation: float32 would change bits.
    """
    return (
        Box(0.0, 1.0, (N_PROXIMITY,), np.float64),
        Box(LOWEST, HIGHEST, (2,), np.float64),
    )


def checked_action(given: object, shape: tuple[int, ...]) -> np.ndarray:
    """Actions of a shape, `(..., 2)`, as floats in memory of their own.

    Raises:
        UserError: for anything else, or an action that is out of bounds.
    """
    try:
        array = np.asarray(given)
    except ValueError:
        # of lists of unlike lengths
        array = np.array(None)
    got = f"{array.dtype} of shape {array.shape}"
    if array.shape == shape and array.dtype.kind in "fiu":
        action = array.astype(float)
        # NaN is within no bounds
        within = ((action >= LOWEST) & (action <= HIGHEST)).all(axis=-1)
        if within.all():
            return action
        v, w = action[~within][0]
        got = f"v = {v:g}, w = {w:g}"
    raise UserError(
        f"expected actions of shape {shape}, v from 0 to 1 and w from -1 to 1, got "
        f"{got}"
    )


def checked_starts(given: object, shape: tuple[int, ...], name: str) -> np.ndarray:
    """Starts of a shape, `(..., 3)`: x, y [m], yaw [rad]; given under that name.

    Raises:
        UserError: for anything else.
    """
    try:
        starts = np.asarray(given, float)
    except (TypeError, ValueError):
        starts = np.full(1, np.nan)
    if starts.shape != shape or not np.isfinite(starts).all():
        raise UserError(
            f"{name}: expected finite numbers of shape {shape}: x, y [m], yaw [rad], "
            f"got {shown(given)}"
        )
    return starts


def check_mode(given: str | None, modes: Sequence[str]) -> None:
    """Refuse a render mode that an environment does not have.

    Raises:
        UserError: for such a mode.
    """
    if given is not None and given not in modes:
        available = ", ".join(("None", *modes))
        raise UserError(f"unknown render_mode {shown(given)}; available: {available}")


def checked_size(width: int, height: int) -> tuple[int, int]:
    """Width and height of pictures [pixels].

    Raises:
        UserError: for anything else.
    """
    try:
        check("pixels", width, "width")
        check("pixels", height, "height")
    except ValueError as error:
        raise UserError(str(error)) from None
    return width, height


def start_of(
    options: dict[str, Any] | None, name: str, shape: tuple[int, ...]
) -> np.ndarray | None:
    """The poses that the options of a reset have under a name, if any.

    Raises:
        UserError: for another name, or for what are no poses.
    """
    given = options or {}
    if unknown := [key for key in given if key != name]:
        raise UserError(f"unknown reset option '{unknown[0]}'; available: {name}")
    return None if name not in given else checked_starts(given[name], shape, name)
