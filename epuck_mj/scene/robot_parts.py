"""Parts that every robot and every arena must have, by MuJoCo's names."""

from pathlib import Path

import mujoco
import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError

PREFIX = "epuck/"
"""What the names of the robot's parts begin with in a scene."""

OWN_BODY = "epuck"
"""Name of the robot's body in its own file."""

ROBOT_BODY = f"{PREFIX}{OWN_BODY}"
SHELL = f"{PREFIX}shell"
WHEELS = (f"{PREFIX}wheel_left", f"{PREFIX}wheel_right")
PROXIMITY = tuple(f"{PREFIX}ps{i}" for i in range(N_PROXIMITY))

_JOINT, _SENSOR = mujoco.mjtJoint, mujoco.mjtSensor


def check_base(model: mujoco.MjModel, robot: Path) -> None:
    """Refuse a robot whose pose cannot be set.

    Raises:
        UserError: for such a robot.
    """
    body = index_of(model, mujoco.mjtObj.mjOBJ_BODY, ROBOT_BODY, robot)
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    types = [_JOINT(kind) for kind in model.jnt_type[first : first + count]]
    if types == [_JOINT.mjJNT_FREE]:
        return
    kinds = [kind.name.removeprefix("mjJNT_").lower() for kind in types]
    raise UserError(
        f"robot '{robot}': expected body '{OWN_BODY}' with a free joint, "
        f"got {', '.join(kinds) or 'none'}"
    )


def static(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms are fixed to the world, `(ngeom,)`."""
    return model.body_weldid[model.geom_bodyid] == 0


def of_robot(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms are the robot's, `(ngeom,)`."""
    return model.body_rootid[model.geom_bodyid] == model.body(ROBOT_BODY).id


def can_touch(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Which geoms a geom can touch, by their collision bits, `(ngeom,)`."""
    bits, masks = model.geom_contype, model.geom_conaffinity
    return ((bits[geom] & masks) | (bits & masks[geom])) != 0


def ray_directions(model: mujoco.MjModel, sites: np.ndarray) -> np.ndarray:
    """Directions of the rays of some sites `(n,)` in the frames of bodies, `(n, 3)`.

    A ray leaves along its site's z axis.
    """
    axes = np.empty((len(sites), 9))
    for i, site in enumerate(sites):
        mujoco.mju_quat2Mat(axes[i], model.site_quat[site])
    return axes[:, [2, 5, 8]]


def sensor_address(model: mujoco.MjModel, name: str, kind: int, robot: Path) -> int:
    """Address in sensordata of a named sensor of a given kind.

    Raises:
        UserError: if there is none.
    """
    sensor = index_of(model, mujoco.mjtObj.mjOBJ_SENSOR, name, robot)
    if model.sensor_type[sensor] != kind:
        raise UserError(
            f"robot '{robot}': expected sensor '{name.removeprefix(PREFIX)}' to be a "
            f"{_SENSOR(kind).name.removeprefix('mjSENS_').lower()}"
        )
    return int(model.sensor_adr[sensor])


def index_of(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, robot: Path) -> int:
    """Index of a named part of the robot.

    Raises:
        UserError: if there is none; names those there are.
    """
    index = mujoco.mj_name2id(model, kind.value, name)
    if index >= 0:
        return index
    label = kind.name.removeprefix("mjOBJ_").lower()
    count = {
        "body": model.nbody,
        "geom": model.ngeom,
        "actuator": model.nu,
        "sensor": model.nsensor,
    }[label]
    names = [mujoco.mj_id2name(model, kind.value, i) or "" for i in range(count)]
    # a robot that was compiled alone has no prefix
    own = [n.removeprefix(PREFIX) for n in names if n.startswith(PREFIX)] or names
    raise UserError(
        f"robot '{robot}' has no {label} '{name.removeprefix(PREFIX)}'; available: "
        + (", ".join(filter(None, own)) or "none")
    )
