"""Robots with bodies of their own in MuJoCo: masses, shapes, faster wheels."""

import numpy as np

from epuck_mj.scene.changed_robots import outward
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import ROBOT_BODY, SHELL
from epuck_mj.step.bodies import SPARE_SPEED, Bodies

Fields = dict[str, tuple[np.ndarray, np.ndarray]]
"""Where fields of MuJoCo's model differ, by name: a mask or indices, and the values
`(robots, ...)` there."""


def wheel_limits(scene: Scene, n: int) -> Fields:
    """Limits of wheels' speeds for `n` robots, whose wheels may be larger."""
    own = scene.model.actuator_ctrlrange[scene.wheels] * SPARE_SPEED
    return {"actuator_ctrlrange": (scene.wheels, np.repeat(own[None], n, axis=0))}


def body_fields(scene: Scene, bodies: Bodies) -> Fields:
    """Masses, inertias, friction and servos of robots with other bodies.

    Servos of half the gain take twice the time.

    Args:
        scene: whose robot is what bodies differ from.
        bodies: of the robots, `(robots,)`.
    """
    model = scene.model
    mass, friction, lag = bodies.mass, bodies.friction, bodies.lag
    robot = model.body_rootid == model.body(ROBOT_BODY).id
    tyres = robot[model.geom_bodyid]
    tyres[model.geom(SHELL).id] = False
    return {
        "body_mass": (robot, model.body_mass[robot] * mass[:, None]),
        "body_inertia": (robot, model.body_inertia[robot] * mass[:, None, None]),
        "geom_friction": (tyres, model.geom_friction[tyres] * friction[:, None, None]),
        **{
            name: (
                scene.wheels,
                getattr(model, name)[scene.wheels] / lag[:, None, None],
            )
            for name in ("actuator_gainprm", "actuator_biasprm")
        },
    }


def shape_fields(scene: Scene, bodies: Bodies) -> Fields:
    """Radii of the shells and places of the sensors; see `body_fields`.

    What MuJoCo works out from them, such as bounding boxes, follows by `mj_setConst`.
    """
    model = scene.model
    shell = np.array([model.geom(SHELL).id])
    size = np.repeat(model.geom_size[None, shell], len(bodies), axis=0)
    size[:, 0, 0] += bodies.wider
    place = model.site_pos[scene.rays] + bodies.outward[:, None, None] * outward(scene)
    return {"geom_size": (shell, size), "site_pos": (scene.rays, place)}
