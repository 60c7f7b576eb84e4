"""Parameters of a robot, in one array: what a fit changes."""

import numpy as np

from epuck_mj.constants import N_PROXIMITY, TRACK, WHEEL_RADIUS
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.motors import STEP_ANGLE

LEFT, RIGHT, OWN_TRACK, LAG = range(4)
GAINS = slice(4, 4 + N_PROXIMITY)
N_PARAMETERS = 4 + N_PROXIMITY
"""Places in the parameters: logarithms of wheel radii, track and gains against the
nominal robot's, and its lag."""


def parameters_of(calibration: Calibration) -> np.ndarray:
    """Parameters `(12,)` of a calibrated robot."""
    found = np.zeros(N_PARAMETERS)
    radii = np.array(calibration.wheel_radii)
    found[[LEFT, RIGHT]] = np.log(radii / WHEEL_RADIUS)
    found[OWN_TRACK] = np.log(calibration.track / TRACK)
    found[LAG] = calibration.lag
    found[GAINS] = np.log(calibration.gains)
    return found


def step_lengths(parameters: np.ndarray) -> np.ndarray:
    """Way of both wheels in a motor step [m], `(2,)`."""
    return STEP_ANGLE * WHEEL_RADIUS * np.exp(parameters[[LEFT, RIGHT]])


def track(parameters: np.ndarray) -> float:
    """Track [m]."""
    return float(TRACK * np.exp(parameters[OWN_TRACK]))


def ahead_and_around(steps: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Way ahead [m] and turn [rad], `(n, 2)`.

    Args:
        steps: of both wheels, `(2, n, 2)`: those that count ahead, and around.
        parameters: of the robot, `(12,)`.
    """
    ahead, around = steps * step_lengths(parameters)
    turn = (around[:, 1] - around[:, 0]) / track(parameters)
    return np.stack([ahead.mean(axis=-1), turn], axis=-1)
