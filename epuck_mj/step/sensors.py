"""Sensors: from a robot's readings to the network's observation.

The same functions serve simulated robots and the real one.
"""

from dataclasses import dataclass

import numpy as np

from epuck_mj.constants import (
    PROXIMITY_COUNT_MAX,
    PROXIMITY_COUNT_NOISE,
    PROXIMITY_COUNTS,
)
from epuck_mj.step.elementary import exp, interpolate, log

PROXIMITY_DISTANCES = np.array(list(PROXIMITY_COUNTS))
LOG_COUNTS = log(np.array(list(PROXIMITY_COUNTS.values())))
NOISE_DISTANCES = np.array(list(PROXIMITY_COUNT_NOISE))
COUNT_NOISE = np.array(list(PROXIMITY_COUNT_NOISE.values()))

PROXIMITY_REACH = float(PROXIMITY_DISTANCES[-1])
"""Farthest distance at which counts were measured [m]: beyond, sensors see nothing."""


@dataclass(frozen=True)
class Reading:
    """Reading of a robot at the end of a control step.

    Attributes:
        distance: metres along each proximity ray from its sensor, `(..., 8)`;
            negative where nothing was hit, as MuJoCo's rangefinders say it.
        contact: whether the shell touched a wall in the step, however briefly,
            `(...,)`, bool.
        proximity: counts that `distance` comes from, `(..., 8)`; None of sensors that
            measure distance itself.
        truth: metres along the rays as they are, `(..., 8)`; None where `distance` is
            that, or if unknown.
    """

    distance: np.ndarray
    contact: np.ndarray
    proximity: np.ndarray | None = None
    truth: np.ndarray | None = None


def proximity(distance: np.ndarray, gains: np.ndarray | float = 1.0) -> np.ndarray:
    """Counts of real robots' sensors, without noise, `(..., 8)`.

    Args:
        distance: metres along each ray, `(..., 8)`; negative is "nothing hit".
        gains: of each sensor against the mean one, `(..., 8)`.

    Returns:
        Counts, growing as things come near; 0 farther than any was measured.

    Source: `PROXIMITY_COUNTS`, its logarithm linear in between.
    """
    logs = interpolate(distance, PROXIMITY_DISTANCES, LOG_COUNTS)
    counts = exp(logs) * gains
    seen = (distance >= 0) & (distance <= PROXIMITY_REACH)
    return np.where(seen, np.minimum(counts, PROXIMITY_COUNT_MAX), 0.0)


def counted(
    distance: np.ndarray, gains: np.ndarray | float, noise: np.ndarray
) -> np.ndarray:
    """Counts as a robot reports them, whole and 12 bits wide, `(..., 8)`.

    Args:
        distance: metres along each ray, `(..., 8)`; negative is "nothing hit".
        gains: of each sensor against the mean one, `(..., 8)`.
        noise: of each reading, in published standard deviations, `(..., 8)`.

    Source: `PROXIMITY_COUNT_NOISE`, linear in between.
    """
    far = np.where(distance < 0, NOISE_DISTANCES[-1], distance)
    deviation = interpolate(far, NOISE_DISTANCES, COUNT_NOISE)
    counts = np.rint(proximity(distance, gains) + noise * deviation)
    return np.clip(counts, 0, PROXIMITY_COUNT_MAX)


def sensed_distance(counts: np.ndarray, gains: np.ndarray | float = 1.0) -> np.ndarray:
    """Distances along the rays from counts [m], `(..., 8)`: inverts `proximity`.

    Few counts are far away: the farthest distance that was ever measured.

    Args:
        counts: of each sensor, `(..., 8)`.
        gains: of each sensor against the mean one, `(..., 8)`.
    """
    logs = log(np.maximum(counts, 1.0) / gains)
    return interpolate(logs, LOG_COUNTS[::-1], PROXIMITY_DISTANCES[::-1])


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
