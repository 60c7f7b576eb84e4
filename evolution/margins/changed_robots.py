"""Changed robots: the kinematic robot with one number that differs."""

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from epuck_mj.constants import BODY_RADIUS
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL


def with_body_radius(scene: Scene, radius: float) -> Scene:
    """The scene with another radius of the robot's shell [m].

    Sensors stay where they are. The maker's page says 35 mm; other sources differ by 1
    to 4 mm.
    """
    model = copy.copy(scene.model)
    shell = model.geom(SHELL).id
    model.geom_rbound[shell] *= radius / model.geom_size[shell, 0]
    model.geom_size[shell, 0] = radius
    return replace(scene, model=model)


def with_sensors_set_back(scene: Scene, back: float) -> Scene:
    """The scene with all proximity sensors so far behind the robot's edge [m]."""
    model = copy.copy(scene.model)
    rays = model.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER
    for site in np.unique(model.sensor_objid[rays]).tolist():
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, model.site_quat[site])
        # a ray leaves along its site's z axis
        model.site_pos[site] -= back * axes.reshape(3, 3)[:, 2]
    return replace(scene, model=model)


@dataclass(frozen=True)
class Change:
    """One number of the robot that is changed.

    Attributes:
        title: what it is, for readers, with the unit.
        own: its amount on the robot of evolution.
        amounts: those that are tried, ascending, in that unit.
        scene: gives the changed scene of a scene and an amount.
        late: whether the amount is a latency instead.
    """

    title: str
    own: float
    amounts: tuple[float, ...]
    scene: Callable[[Scene, float], Scene]
    late: bool = False


MILLIMETRES = 1000

CHANGES: Mapping[str, Change] = {
    "body_radius": Change(
        "radius of the body [mm]",
        BODY_RADIUS * MILLIMETRES,
        (34, 34.5, 35, 35.5, 36, 36.5, 37, 37.5, 38),
        lambda scene, mm: with_body_radius(scene, mm / MILLIMETRES),
    ),
    "sensors_set_back": Change(
        "sensors set back by [mm]",
        0,
        (0, 0.5, 1, 1.5, 2, 2.5, 3),
        lambda scene, mm: with_sensors_set_back(scene, mm / MILLIMETRES),
    ),
    "latency": Change(
        "commands late by [control steps]",
        0,
        (0, 1, 2),
        lambda scene, _: scene,
        late=True,
    ),
}
"""The changes by name."""
