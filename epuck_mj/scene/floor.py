"""The floor of a scene: what wheels and supports roll on.

Wheels meet what has collision bit 2, the shell what has bit 1. A plane or a box that is
level at height 0 is a floor, whatever its own bits are: they are changed.
"""

from pathlib import Path

import mujoco
import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.robot_parts import ROBOT_BODY, static

FLOOR_BITS = 2

LEVEL = 1e-9
"""How far from 1 the vertical part of a level surface's normal may be."""

HEIGHT = 1e-6
"""How far from 0 a floor's height may be [m]."""

_SHAPE = mujoco.mjtGeom


class BadGeom(UserError):
    """A geom of an arena that would change how the robot rolls or crashes."""

    def __init__(self, model: mujoco.MjModel, geom: int, arena: Path, problem: str):
        """Store the geom's index and what is wrong."""
        name = model.geom(geom).name
        shown = f"geom '{name}'" if name else f"geom number {geom}"
        super().__init__(f"arena '{arena}', {shown}: {problem}")
        self.geom, self.problem = geom, problem


def lay_floor(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, tuple[int, ...]]:
    """A scene's model, and which of its geoms had to be given a floor's bits."""
    model = spec.compile()
    ground = floors(model)
    bits = np.stack([model.geom_contype, model.geom_conaffinity])
    others = ground & (bits != FLOOR_BITS).any(axis=0)
    if not others.any():
        return model, ()
    # things of the arena that move still need their floor
    moves = (~static(model) & ~_of_robot(model)).any()
    for geom in spec.geoms:
        if others[geom.id]:
            geom.contype = geom.contype | FLOOR_BITS if moves else FLOOR_BITS
            geom.conaffinity = geom.conaffinity | FLOOR_BITS if moves else FLOOR_BITS
    return spec.compile(), tuple(np.flatnonzero(others).tolist())


def floors(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms are level at height 0, `(ngeom,)`."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rotation = data.geom_xmat.reshape(-1, 3, 3)
    # of a box, any side may be up
    up = np.abs(rotation[:, 2, :]).argmax(axis=1)
    level = np.abs(rotation[np.arange(model.ngeom), 2, up]) > 1 - LEVEL
    plane = (model.geom_type == _SHAPE.mjGEOM_PLANE) & (rotation[:, 2, 2] > 0)
    box = model.geom_type == _SHAPE.mjGEOM_BOX
    top = data.geom_xpos[:, 2] + box * model.geom_size[np.arange(model.ngeom), up]
    level &= (plane & (up == 2)) | box
    return static(model) & ~_of_robot(model) & level & (np.abs(top) <= HEIGHT)


def check_floor(model: mujoco.MjModel, arena: Path) -> None:
    """Refuse a robot on wheels without a floor, and level planes at other heights.

    Raises:
        UserError: naming the plane.
    """
    data, ground = mujoco.MjData(model), floors(model)
    mujoco.mj_kinematics(model, data)
    level = data.geom_xmat[:, 8] > 1 - LEVEL
    planes = level & (model.geom_type == _SHAPE.mjGEOM_PLANE) & ~_of_robot(model)
    for geom in np.flatnonzero(planes & ~ground & static(model)).tolist():
        height = 1000 * data.geom_xpos[geom, 2]
        problem = f"a floor at height {height:g} mm; expected 0"
        raise BadGeom(model, geom, arena, problem)
    base = model.body_jntadr[model.body(ROBOT_BODY).id]
    rolls = model.jnt_type[base] == mujoco.mjtJoint.mjJNT_FREE
    if rolls and not ground.any():
        raise UserError(
            f"arena '{arena}' has no floor for the robot's wheels: expected a plane or "
            "the top of a level box at height 0"
        )


def check_contacts(model: mujoco.MjModel, arena: Path) -> None:
    """Refuse geoms that would change how the robot's own touch them.

    Raises:
        UserError: naming the geom.
    """
    mine = _of_robot(model)
    priority = model.geom_priority[mine].max()
    for geom in np.flatnonzero(~mine).tolist():
        if model.geom_margin[geom] or model.geom_gap[geom]:
            problem = "margin and gap have to be 0: robots would crash before or after "
            raise BadGeom(model, geom, arena, f"{problem}they touch it")
        if model.geom_priority[geom] >= priority > 0:
            problem = (
                f"priority has to be below {priority}, that of the robot's wheels, "
            )
            raise BadGeom(model, geom, arena, f"{problem}whose friction counts")


def _of_robot(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms are the robot's, `(ngeom,)`."""
    return model.body_rootid[model.geom_bodyid] == model.body(ROBOT_BODY).id
