"""Changed robots: a scene's robot with one number that differs."""

import copy
from dataclasses import replace

import mujoco
import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL, ray_directions

ROUND = (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE)
"""Shapes whose first size is a radius, and that are as wide in every direction."""


def with_body_radius(scene: Scene, radius: float) -> Scene:
    """The scene with another radius of the robot's shell [m].

    Sensors stay where they are. The maker's page says 35 mm; other sources differ by 1
    to 4 mm.

    Raises:
        UserError: if the shell has none.
    """
    if scene.model.geom(SHELL).type.item() not in ROUND:
        raise UserError(
            f"robot '{scene.name}': expected a shell that is a cylinder, to change its "
            "radius"
        )
    model = copy.copy(scene.model)
    shell = model.geom(SHELL).id
    model.geom_rbound[shell] *= radius / model.geom_size[shell, 0]
    model.geom_size[shell, 0] = radius
    return replace(scene, model=model)


def with_sensors_set_back(scene: Scene, back: float) -> Scene:
    """The scene with all proximity sensors so far behind the robot's edge [m]."""
    model = copy.copy(scene.model)
    model.site_pos[scene.rays] -= back * outward(scene)
    return replace(scene, model=model)


def with_body_margin(scene: Scene, margin: float) -> Scene:
    """The scene with a shell whose radius is larger by `margin` [m].

    Raises:
        UserError: if the shell has no radius.
    """
    if not margin:
        return scene
    return with_body_radius(scene, scene.model.geom(SHELL).size[0] + margin)


def outward(scene: Scene) -> np.ndarray:
    """Directions in which rays move with their sensors, as `Scene.rays`, `(rays, 3)`.

    A sensor moves along its middle ray.
    """
    middle = ray_directions(scene.model, scene.rays[:N_PROXIMITY])
    return np.tile(middle, (len(scene.rays) // N_PROXIMITY, 1))
