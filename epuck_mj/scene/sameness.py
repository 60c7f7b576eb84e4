"""Comparison of a robot in an arena with the same robot compiled alone."""

from pathlib import Path

import mujoco
import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.robot_parts import OWN_BODY, PREFIX, ROBOT_BODY

_OBJECT = mujoco.mjtObj

KINDS = {
    "body": ("nbody", _OBJECT.mjOBJ_BODY),
    "jnt": ("njnt", _OBJECT.mjOBJ_JOINT),
    "geom": ("ngeom", _OBJECT.mjOBJ_GEOM),
    "site": ("nsite", _OBJECT.mjOBJ_SITE),
    "actuator": ("nu", _OBJECT.mjOBJ_ACTUATOR),
    "sensor": ("nsensor", _OBJECT.mjOBJ_SENSOR),
    "dof": ("nv", _OBJECT.mjOBJ_DOF),
}
"""Parts that are compared, by the prefix of their fields: their number, their kind."""

RELATIVE = 1e-12
"""Largest relative difference of equal numbers: another order of sums is no change."""

PLACES = ("adr", "id", "num", "sameframe", "treeid", "user")
"""Endings of fields that say where in the model something is, not what it is.

And of data for a user's own program, whose number is the arena's choice.
"""


def check_same(model: mujoco.MjModel, alone: mujoco.MjModel, arena: Path) -> None:
    """Refuse an arena that changes masses, joints, actuators or sensors of its robot.

    Args:
        model: the robot in the arena.
        alone: the robot without one.
        arena: path of the arena's MJCF.

    Raises:
        UserError: naming the first difference.
    """
    here, there = _parts(model, ROBOT_BODY, alone), _parts(alone, OWN_BODY, alone)
    for kind, (_, label) in KINDS.items():
        own, its = here[kind], there[kind]
        name = label.name.removeprefix("mjOBJ_").lower()
        if len(own) != len(its):
            raise UserError(
                f"arena '{arena}' changes the robot: expected {len(its)} parts of kind "
                f"{name}, got {len(own)}"
            )
        for field in _fields(model, kind):
            values, expected = getattr(model, field)[own], getattr(alone, field)[its]
            same = np.isclose(values, expected, RELATIVE, 0)
            wrong = ~same.reshape(len(own), -1).all(axis=1)
            for i in np.flatnonzero(wrong).tolist():
                part = mujoco.mj_id2name(model, label.value, own[i]) or f"{i}"
                raise UserError(
                    f"arena '{arena}' changes the robot: {field} of {name} "
                    f"'{part.removeprefix(PREFIX)}': expected {_shown(expected[i])}, "
                    f"got {_shown(values[i])}"
                )
    for field in (name for name in dir(model.opt) if not name.startswith("_")):
        if not np.array_equal(getattr(model.opt, field), getattr(alone.opt, field)):
            raise UserError(f"arena '{arena}' changes the robot's option '{field}'")


def _parts(
    model: mujoco.MjModel, body: str, alone: mujoco.MjModel
) -> dict[str, np.ndarray]:
    """Indices of a robot's parts by kind."""
    mine = model.body_rootid == model.body(body).id
    return {
        "body": np.flatnonzero(mine),
        "jnt": np.flatnonzero(mine[model.jnt_bodyid]),
        "geom": np.flatnonzero(mine[model.geom_bodyid]),
        "site": np.flatnonzero(mine[model.site_bodyid]),
        "dof": np.flatnonzero(mine[model.dof_bodyid]),
        # the robot is attached last
        "actuator": np.arange(model.nu - alone.nu, model.nu),
        "sensor": np.arange(model.nsensor - alone.nsensor, model.nsensor),
    }


def _fields(model: mujoco.MjModel, kind: str) -> list[str]:
    """Names of the fields that describe a kind of part."""
    count = getattr(model, KINDS[kind][0])
    fields = []
    for name in dir(model):
        if name.startswith(f"{kind}_") and not name.endswith(PLACES):
            value = getattr(model, name)
            if isinstance(value, np.ndarray) and value.shape[:1] == (count,):
                fields.append(name)
    return fields


def _shown(value: np.ndarray) -> str:
    return " ".join(f"{number:g}" for number in np.ravel(value).astype(float))
