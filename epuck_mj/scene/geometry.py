"""Geometry of a compiled scene: shapes, colours and places of its geoms."""

import mujoco
import numpy as np

from epuck_mj.scene.boxes import at_rest, box_around
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL, can_touch, static

UNSET_COLOR = np.array([0.5, 0.5, 0.5, 1], np.float32)
"""Colour that MuJoCo gives to geoms without one."""

COLLISION_GROUP = 3
"""First group of geoms that are not meant to be seen, as in mujoco_menagerie."""


def mesh(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices `(n, 3)` [m] and faces `(m, 3)` of a geom that is a mesh."""
    found = model.mesh(model.geom_dataid[geom])
    return (
        model.mesh_vert[found.vertadr[0] :][: found.vertnum[0]],
        model.mesh_face[found.faceadr[0] :][: found.facenum[0]],
    )


def walls(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms stand still and can be hit by the robot's shell, `(ngeom,)`."""
    return can_touch(model, model.geom(SHELL).id) & static(model)


def seen_by_rays(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms a rangefinder can hit, `(ngeom,)`; see `mj_ray`.

    Rays meet geoms of any group and any collision bits. They pass through those of
    alpha 0, where a material's alpha counts before the geom's own.
    """
    alpha, material = model.geom_rgba[:, 3].copy(), model.geom_matid
    alpha[material >= 0] = model.mat_rgba[material[material >= 0], 3]
    return alpha > 0


def moving_bodies(model: mujoco.MjModel) -> list[int]:
    """Bodies that are not welded to the world."""
    return np.flatnonzero(model.body_weldid != 0).tolist()


def box_around_walls(
    model: mujoco.MjModel,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners of the box around the walls, `(3,)` each [m]; None without walls.

    Of a plane, which has no end, the point that its MJCF names counts.
    """
    solid = walls(model)
    box = box_around(model, solid)
    planes = solid & (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    corners = [at_rest(model).geom_xpos[planes], *([] if box is None else [box])]
    points = np.concatenate(corners)
    return (points.min(axis=0), points.max(axis=0)) if len(points) else None


def arena_box(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box around the visible arena, `(3,)` each [m]."""
    box = box_around(model, drawn(model) & static(model))
    # an arena of a floor only
    return box or (np.array([-0.5, -0.5, 0.0]), np.array([0.5, 0.5, 0.0]))


def drawn(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms are meant to be seen, `(ngeom,)`.

    Collision geoms are, if their body has nothing else to show.
    """
    visible = np.array([color(model, geom)[3] > 0 for geom in range(model.ngeom)])
    looks = visible & (model.geom_group < COLLISION_GROUP)
    has_looks = np.zeros(model.nbody, bool)
    has_looks[model.geom_bodyid[looks]] = True
    return looks | (visible & ~has_looks[model.geom_bodyid])


def color(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Colour of a geom, `(4,)` in [0, 1], as MuJoCo picks it; a texture's mean."""
    rgba, material = model.geom_rgba[geom].copy(), model.geom_matid[geom]
    # the material's, unless the geom has a colour of its own
    if material < 0 or (rgba != UNSET_COLOR).any():
        return rgba
    rgba = model.mat_rgba[material].copy()
    texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if texture >= 0:
        rgba[:3] *= model.texture(texture).data[..., :3].mean(axis=(0, 1)) / 255
    return rgba


def kinematics(
    scene: Scene, poses: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places of bodies and rays in the world, for each pose `(n, 3)`.

    Returns:
        Positions [m] and quaternions of all bodies, `(n, nbody, 3)`, `(n, nbody, 4)`;
        origins [m] and directions of the rays, `(n, rays, 3)` both: see `Scene.rays`.
    """
    model, data, sites = scene.model, mujoco.MjData(scene.model), scene.rays
    position, quaternion, origin, direction = [], [], [], []
    for qpos in scene.qpos(poses):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        position.append(data.xpos.copy())
        quaternion.append(data.xquat.copy())
        origin.append(data.site_xpos[sites])
        # a rangefinder looks along the z axis of its site
        direction.append(data.site_xmat[sites][:, [2, 5, 8]])
    return (
        np.array(position),
        np.array(quaternion),
        np.array(origin),
        np.array(direction),
    )
