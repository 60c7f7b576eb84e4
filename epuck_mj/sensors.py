"""From what the robot senses to what the network sees.

Everything above this line is the same in simulation and on the robot.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Reading:
    """What a robot reports at the end of a control step.

    Attributes:
        distance: metres along each proximity ray from the shell, `(..., 8)`;
            negative where nothing was hit, as MuJoCo's rangefinders say it.
        contact: whether the shell touches a wall, `(...,)`, bool.
    """

    distance: np.ndarray
    contact: np.ndarray


def observe(distance: np.ndarray, sensor_range: float) -> np.ndarray:
    """Network input: 0 at contact, growing linearly to 1 at `sensor_range`.

    Args:
        distance: metres along each ray, `(..., 8)`; negative is "nothing hit".
        sensor_range: where an obstacle stops being seen [m].

    Returns:
        Observation `(..., 8)` in [0, 1].

    Source: paper, section 4 (0 near, 1 free; range 4 cm).
    """
    seen = np.where(distance < 0, sensor_range, distance)
    return np.minimum(seen / sensor_range, 1.0)
