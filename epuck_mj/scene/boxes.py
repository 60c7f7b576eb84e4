"""Where geoms are before anything moves, and the boxes around them."""

import mujoco
import numpy as np


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    """State of a scene before anything moves."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data


def box_around(
    model: mujoco.MjModel, geoms: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners of the box around the geoms of a mask `(ngeom,)`, `(3,)` each [m].

    Planes have no end and do not count; None where nothing is left.
    """
    geoms = geoms & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    if not geoms.any():
        return None
    low, high = boxes(model, np.flatnonzero(geoms))
    return low.min(axis=0), high.max(axis=0)


def boxes(model: mujoco.MjModel, geoms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box around each geom of some `(n,)`, `(n, 3)` both [m].

    Planes have no end: theirs are infinite.
    """
    data = at_rest(model)
    box, rotation = model.geom_aabb[geoms], data.geom_xmat[geoms].reshape(-1, 3, 3)
    center = data.geom_xpos[geoms] + np.einsum("nij,nj->ni", rotation, box[:, :3])
    half = np.einsum("nij,nj->ni", np.abs(rotation), box[:, 3:])
    half[model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_PLANE] = np.inf
    return center - half, center + half
