"""The rays of the proximity sensors, as pictures and recordings show them."""

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.scene.geometry import kinematics
from epuck_mj.scene.model import Scene
from epuck_mj.show.colors import FAINT, VERMILION, blend
from epuck_mj.trials.trajectory import Trajectory

NEAR_COLOR, FREE_COLOR = VERMILION, FAINT
"""Colours of a ray, from contact to nothing seen."""


def ray_lines(
    scene: Scene, trajectory: Trajectory, sensor_range: float
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the rays at each reading, and their colours by what the network sees.

    Args:
        scene: whose robot drives.
        trajectory: of `T` control steps.
        sensor_range: where a ray ends that hits nothing [m].

    Returns:
        Ends `(T + 1, rays, 2, 3)` [m], and colours `(T + 1, rays, 3)`, 0 to 255; all
        rays of a sensor are as long as what it measures.
    """
    *_, origin, direction = kinematics(scene, trajectory.pose)
    each = (1, origin.shape[1] // N_PROXIMITY)
    distance = np.tile(trajectory.distance, each)
    length = np.where(distance < 0, sensor_range, distance)
    length = np.minimum(length, sensor_range)[..., None]
    lines = np.stack([origin, origin + length * direction], axis=2)
    seen = np.tile(trajectory.observation, each)
    colors = blend(NEAR_COLOR, FREE_COLOR, seen.ravel())
    return lines, colors.reshape(*seen.shape, 3)
