"""Sensors with three rays in a compiled scene: which these are, and their angles.

A robot's rangefinders `ps0_left` and `ps0_right` are further rays of its sensor `ps0`.
"""

from pathlib import Path

import mujoco
import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.scene.boxes import at_rest
from epuck_mj.scene.robot_parts import PREFIX, PROXIMITY

LEFT, RIGHT = ([f"{name}_{side}" for name in PROXIMITY] for side in ("left", "right"))

ANGLE_ERROR = 0.1
"""Largest error of a ray's direction [degrees]: four digits are enough."""

PLACE_ERROR = 1e-4
"""Largest distance between places where rays of a sensor begin [m]."""

SIDEWAYS_MAX = 90.0
"""Angle that outer rays have to be below [degrees]."""


def ray_names(model: mujoco.MjModel, robot: Path) -> list[str]:
    """Names of the rays of all sensors, `(8,)` or `(24,)`.

    First the one that each has, or its middle one, then all to the left, then all to
    the right.

    Raises:
        UserError: if only some sensors have outer rays.
    """
    kind = mujoco.mjtObj.mjOBJ_SENSOR.value
    outer = [*LEFT, *RIGHT]
    missing = [name for name in outer if mujoco.mj_name2id(model, kind, name) < 0]
    if len(missing) == len(outer):
        return list(PROXIMITY)
    if missing:
        there = next(name for name in outer if name not in missing)
        raise UserError(
            f"robot '{robot}' has a rangefinder '{_own(there)}': expected psK_left and "
            f"psK_right for every K from 0 to {N_PROXIMITY - 1}, got no "
            f"'{_own(missing[0])}'"
        )
    return [*PROXIMITY, *outer]


def cosines_of(model: mujoco.MjModel, names: list[str], robot: Path) -> np.ndarray:
    """Cosines of the angles between middle and outer rays, `(8,)`.

    Args:
        model: the compiled scene.
        names: of the rays, as of `ray_names`.
        robot: path of the robot's MJCF.

    Returns:
        The cosines; none, `(0,)`, of sensors with one ray.

    Raises:
        UserError: if the rays of a sensor are no cone.
    """
    if len(names) == N_PROXIMITY:
        return np.zeros(0)
    data = at_rest(model)
    sites = [model.sensor(name).objid[0] for name in names]
    place = data.site_xpos[sites].reshape(3, N_PROXIMITY, 3)
    direction = data.site_xmat[sites][:, [2, 5, 8]].reshape(3, N_PROXIMITY, 3)
    for k in range(N_PROXIMITY):
        found = _fault(place[:, k], direction[:, k])
        if found:
            raise UserError(
                f"robot '{robot}': expected rays 'ps{k}_left' and 'ps{k}_right' to "
                f"begin where 'ps{k}' does, in one plane with it, at equal angles "
                f"below {SIDEWAYS_MAX:g} degrees to its left and right; got {found}"
            )
    middle, left, right = direction
    return ((middle * left).sum(axis=-1) + (middle * right).sum(axis=-1)) / 2


def _fault(place: np.ndarray, direction: np.ndarray) -> str:
    """What is wrong with the middle, left and right ray of a sensor; "" if nothing.

    Args:
        place: where they begin [m], `(3, 3)`.
        direction: theirs, `(3, 3)`.
    """
    middle, left, right = direction
    apart = np.linalg.norm(place[1:] - place[0], axis=1).max()
    if apart > PLACE_ERROR:
        return f"a ray that begins {1000 * apart:.1f} mm beside it"
    angles = _leftward(middle, left), -_leftward(middle, right)
    ordered = min(angles) > 0 and max(angles) < SIDEWAYS_MAX
    if not ordered or abs(angles[0] - angles[1]) > ANGLE_ERROR:
        return f"{angles[0]:.1f} degrees to the left and {angles[1]:.1f} to the right"
    normal = np.cross(middle, left)
    out = np.degrees(np.arcsin(abs(normal @ right) / np.linalg.norm(normal)))
    if out > ANGLE_ERROR:
        return f"a ray {out:.1f} degrees out of the plane of the others"
    return ""


def _leftward(middle: np.ndarray, other: np.ndarray) -> float:
    """Angle from one ray to another [degrees], positive to the left."""
    normal = np.cross(middle, other)
    angle = np.degrees(np.arctan2(np.linalg.norm(normal), middle @ other))
    return float(np.copysign(angle, normal[2]))


def _own(name: str) -> str:
    return name.removeprefix(PREFIX)
