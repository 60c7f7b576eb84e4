"""The floor of a scene: what wheels and supports roll on.

Wheels meet what has collision bit 2, the shell what has bit 1. A plane or a box that is
level at the floor's height is a floor, whatever its own bits are: they are changed.
That height is 0, or where an arena has its board or mat instead.
"""

from pathlib import Path

import mujoco
import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.boxes import at_rest, box_around
from epuck_mj.scene.robot_parts import SHELL, can_touch, of_robot, static

FLOOR_BITS = 2

MOVER_BIT = 1 << 30
"""Bit by which things of the arena that move keep meeting a floor without bit 1."""

LEVEL = 1e-9
"""How far from 1 the vertical part of a level surface's normal may be."""

HEIGHT = 1e-6
"""How far from the floor's height a part of it may be [m]."""

BOARD_HEIGHT = 0.05
"""How far from 0 the floor's height may be [m]: a board, a mat, a plane below a ball.

One of the robot's heights: walls that stand on 0 are still in its way.
"""

BOARD_SHARE = 0.5
"""Least share of an arena that a box covers on which all of it stands."""

_SHAPE = mujoco.mjtGeom


class BadGeom(UserError):
    """A geom of an arena that would change how the robot rolls or crashes."""

    def __init__(self, model: mujoco.MjModel, geom: int, arena: Path, problem: str):
        """Store the geom's index and what is wrong."""
        name = model.geom(geom).name
        shown = f"geom '{name}'" if name else f"geom number {geom}"
        super().__init__(f"arena '{arena}', {shown}: {problem}")
        self.geom, self.problem = geom, problem


def lay_floor(
    spec: mujoco.MjSpec, robot: mujoco.MjsFrame
) -> tuple[mujoco.MjModel, tuple[int, ...], float]:
    """Put a robot on the floor of its scene.

    Args:
        spec: the scene.
        robot: the frame that the robot is in, at height 0.

    Returns:
        The model, which of its geoms had to be given a floor's bits, and the height
        of the floor [m].
    """
    model = spec.compile()
    height = floor_height(model)
    bits = np.stack([model.geom_contype, model.geom_conaffinity])
    others = floors(model, height) & (bits != FLOOR_BITS).any(axis=0)
    if height == 0 and not others.any():
        return model, (), 0.0
    robot.pos = [0, 0, height]
    # things of the arena that move still need their floor
    movers = ~static(model) & ~of_robot(model)
    met = [can_touch(model, geom) for geom in np.flatnonzero(others).tolist()]
    movers &= np.any(met, axis=0)
    for geom in spec.geoms:
        if others[geom.id]:
            geom.contype = FLOOR_BITS
            geom.conaffinity = FLOOR_BITS | (MOVER_BIT if movers.any() else 0)
        elif movers[geom.id]:
            geom.contype |= MOVER_BIT
    return spec.compile(), tuple(np.flatnonzero(others).tolist()), height


def floor_height(model: mujoco.MjModel) -> float:
    """Height on which an arena lets robots stand [m]; 0 if it has no floor."""
    top, area = level_tops(model)
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    boards = solid & (np.abs(top) <= BOARD_HEIGHT)
    boards &= area >= BOARD_SHARE * _area(model)
    if (np.abs(top) <= HEIGHT).any() or not boards.any():
        return 0.0
    return float(top[boards].max())


def floors(model: mujoco.MjModel, height: float) -> np.ndarray:
    """Which geoms are level at the height of the floor [m], `(ngeom,)`."""
    top, _ = level_tops(model)
    return np.abs(top - height) <= HEIGHT


def level_tops(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """The arena's still planes and boxes that are level.

    Returns:
        Heights of their tops [m], NaN for all other geoms, and their areas [m^2],
        `(ngeom,)` both.
    """
    data = at_rest(model)
    rotation, every = data.geom_xmat.reshape(-1, 3, 3), np.arange(model.ngeom)
    # of a box, any side may be up
    up = np.abs(rotation[:, 2, :]).argmax(axis=1)
    level = np.abs(rotation[every, 2, up]) > 1 - LEVEL
    plane = (model.geom_type == _SHAPE.mjGEOM_PLANE) & (rotation[:, 2, 2] > 0)
    box = model.geom_type == _SHAPE.mjGEOM_BOX
    level &= ((plane & (up == 2)) | box) & static(model) & ~of_robot(model)
    half = np.where(box, model.geom_size[every, up], 0)
    sides = model.geom_size[every, (up + 1) % 3] * model.geom_size[every, (up + 2) % 3]
    top = np.where(level, data.geom_xpos[:, 2] + half, np.nan)
    return top, np.where(plane, np.inf, 4 * sides)


def check_floor(model: mujoco.MjModel, height: float, arena: Path) -> None:
    """Refuse an arena without a floor, or with one that is too high or too low.

    Args:
        model: the scene.
        height: of the floor [m].
        arena: path of the arena's MJCF.

    Raises:
        UserError: naming the floor, if there is one.
    """
    top, area = level_tops(model)
    planes = model.geom_type == _SHAPE.mjGEOM_PLANE
    # all that is below a plane is inside of it
    above = planes & (top > height + HEIGHT) & can_touch(model, model.geom(SHELL).id)
    if not above.any() and floors(model, height).any():
        return
    if above.any():
        top = np.where(above, top, np.nan)
    # the largest, and among planes the one next to 0
    best = int(np.lexsort([-np.abs(top), np.where(np.isnan(top), 0, area)])[-1])
    if np.isnan(top[best]) or area[best] < BOARD_SHARE * _area(model):
        raise UserError(
            f"arena '{arena}' has no floor for the robot's wheels: expected a plane or "
            "the top of a level box at height 0"
        )
    problem = f"a floor at height {1000 * top[best]:g} mm; expected 0"
    if abs(top[best]) > BOARD_HEIGHT:
        problem += f", or at most {1000 * BOARD_HEIGHT:g} mm from it"
    raise BadGeom(model, best, arena, problem)


def _area(model: mujoco.MjModel) -> float:
    """Area that the still geoms of an arena take, seen from above [m^2]."""
    box = box_around(model, static(model) & ~of_robot(model))
    return 0.0 if box is None else float(np.prod((box[1] - box[0])[:2]))
