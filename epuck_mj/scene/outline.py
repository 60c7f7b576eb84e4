"""Outlines of walls and of the robot's shell from above, for figures."""

import mujoco
import numpy as np

from epuck_mj.scene.geometry import at_rest, mesh, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL

OUTLINE_POINTS = 64
"""Number of directions in which an outline is sampled."""


def wall_outlines(scene: Scene) -> list[np.ndarray]:
    """Outlines of the walls from above, `(points, 2)` each [m]."""
    model, data = scene.model, at_rest(scene.model)
    solid = walls(model) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    return [
        _outline(model, geom, data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3))
        for geom in np.flatnonzero(solid).tolist()
    ]


def shell_outline(scene: Scene) -> np.ndarray:
    """The shell from above, `(points, 2)` [m], x forward and y left of the robot."""
    shell = scene.model.geom(SHELL)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, shell.quat)
    return _outline(scene.model, shell.id, shell.pos, rotation.reshape(3, 3))


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
