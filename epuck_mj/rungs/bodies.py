"""Robots with bodies of their own in MuJoCo: masses, friction, faster wheels."""

import numpy as np

from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import ROBOT_BODY, SHELL

SPARE_SPEED = 2.0
"""Highest wheel speed of embodied robots, as a multiple of the actuators' limits."""

Fields = dict[str, tuple[np.ndarray, np.ndarray]]
"""Where fields of MuJoCo's model differ, by name: a mask or indices, and the values
`(robots, ...)` there."""


def wheel_limits(scene: Scene, n: int) -> Fields:
    """Limits of wheels' speeds for `n` robots, whose wheels may be larger."""
    own = scene.model.actuator_ctrlrange[scene.wheels] * SPARE_SPEED
    return {"actuator_ctrlrange": (scene.wheels, np.repeat(own[None], n, axis=0))}


def body_fields(
    scene: Scene, mass: np.ndarray, friction: np.ndarray, lag: np.ndarray
) -> Fields:
    """Masses, inertias, friction and servos of robots with other bodies.

    Args:
        scene: whose robot has mass, friction and lag 1.
        mass: of each robot against the scene's, `(robots,)`.
        friction: of all its geoms but the shell, likewise.
        lag: of its drive's time constants, likewise: servos of half the gain take
            twice the time.
    """
    model = scene.model
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
