"""Outlines of walls and of the robot's shell from above, for figures."""

import mujoco
import numpy as np

from epuck_mj.scene.boxes import at_rest
from epuck_mj.scene.geometry import mesh, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL

OUTLINE_POINTS = 64
"""Number of directions in which an outline is sampled."""

PLANE_SIZE, PLANE_DEPTH = 50.0, 0.01
"""Half width of an endless plane and depth behind any plane, as they are drawn [m]."""


def wall_outlines(scene: Scene) -> list[np.ndarray]:
    """Outlines of the walls from above, `(points, 2)` each [m]."""
    return geom_outlines(scene, walls(scene.model))


def geom_outlines(scene: Scene, geoms: np.ndarray) -> list[np.ndarray]:
    """Outlines of the geoms of a mask `(ngeom,)` from above, `(points, 2)` each [m]."""
    model, data = scene.model, at_rest(scene.model)
    return [
        _outline(model, geom, data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3))
        for geom in np.flatnonzero(geoms).tolist()
    ]


def shell_outline(scene: Scene) -> np.ndarray:
    """The shell from above, `(points, 2)` [m], x forward and y left of the robot."""
    shell = scene.model.geom(SHELL)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, shell.quat)
    return _outline(scene.model, shell.id, shell.pos, rotation.reshape(3, 3))


def within(outline: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which of points `(n, 2)` lie within a convex outline, `(n,)`."""
    side = np.roll(outline, -1, axis=0) - outline
    to_point = points[:, None] - outline
    left = side[:, 0] * to_point[..., 1] >= side[:, 1] * to_point[..., 0]
    return np.asarray(left.all(axis=1))


def _outline(
    model: mujoco.MjModel, geom: int, position: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """A geom's convex outline from above: its farthest point in each direction."""
    angles = np.linspace(0, 2 * np.pi, OUTLINE_POINTS, endpoint=False)
    flat = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    directions = flat @ rotation
    size, kind = model.geom_size[geom], mujoco.mjtGeom(model.geom_type[geom])
    match kind:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            points = size[0] * directions
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            points = size * _unit(size * directions)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            points = size[0] * directions
            points[:, 2] += size[1] * np.sign(directions[:, 2])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            points = size[0] * _unit(directions * [1, 1, 0])
            points[:, 2] = size[1] * np.sign(directions[:, 2])
        case mujoco.mjtGeom.mjGEOM_PLANE:
            # what lies behind it, as far as a picture shows
            half = np.where(size[:2] > 0, size[:2], PLANE_SIZE)
            points = np.sign(directions) * [*half, PLANE_DEPTH]
            points[:, 2] = np.minimum(points[:, 2], 0)
        case mujoco.mjtGeom.mjGEOM_MESH:
            vertices, _ = mesh(model, geom)
            points = vertices[np.argmax(directions @ vertices.T, axis=1)]
        case _:
            center, half = model.geom_aabb[geom].reshape(2, 3)
            points = center + half * np.sign(directions)
    return (position + points @ rotation.T)[:, :2]


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors `(n, 3)` scaled to length 1; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(length, np.finfo(float).tiny)
