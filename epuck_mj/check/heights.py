"""Heights at which a robot can hit and see things, and those of a geom."""

from dataclasses import dataclass

import mujoco
import numpy as np

from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.scene.boxes import box_around, boxes
from epuck_mj.scene.geometry import kinematics
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL


@dataclass(frozen=True)
class Heights:
    """Heights in which a robot can hit and see [m]."""

    shell: tuple[float, float]
    rays: tuple[float, float]


def heights_of(scene: Scene) -> Heights:
    """Where shell and rays of a robot are, upright on a floor at 0."""
    model = scene.model
    shell = np.arange(model.ngeom) == model.geom(SHELL).id
    box = box_around(model, shell)
    assert box is not None, "the shell is no plane"
    _, _, origin, direction = kinematics(scene, np.zeros((1, 3)))
    ends = origin[..., 2], (origin + PROXIMITY_RANGE * direction)[..., 2]
    low, high = np.min(ends), np.max(ends)
    return Heights((box[0][2], box[1][2]), (float(low), float(high)))


def extents(model: mujoco.MjModel) -> np.ndarray:
    """Lowest and highest point of each geom [m], `(ngeom, 2)`; of planes, no end."""
    low, high = boxes(model, np.arange(model.ngeom))
    return np.stack([low[:, 2], high[:, 2]], axis=1)


def extent(model: mujoco.MjModel, geom: int) -> tuple[float, float]:
    """Lowest and highest point of a geom [m]; of a plane, no end."""
    low, high = extents(model)[geom].tolist()
    return low, high


def mm(height: float) -> str:
    """A height as text."""
    return f"{height * 1000:.1f} mm"
