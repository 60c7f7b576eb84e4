"""Phases: what a robot does at each moment of a trial, by true geometry."""

import numpy as np

from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.trials.trajectory import Trajectory

SEARCHING, FOLLOWING = "searching", "following"
CORNERING, CRASHED = "cornering", "crashed"
"""Names of the phases: away from walls; near one; near one and turning; crashed."""

CORNERING_TIME = 1.0
"""Time around a moment in which turns are summed [s], to ignore wiggles."""

CORNERING_TURN = np.pi / 6
"""Least net turn in CORNERING_TIME of a robot that takes a corner [rad].

At full speed, a wall of less than a quarter of a metre radius.
"""


def phases(trajectory: Trajectory, clearance: np.ndarray) -> np.ndarray:
    """Phase of each sensed row, `(T + 1,)`.

    Args:
        trajectory: what happened.
        clearance: from the shell to the nearest wall on each pose [m], `(T + 1,)`.
    """
    near = clearance <= PROXIMITY_RANGE
    turning = np.abs(_turn(trajectory)) >= CORNERING_TURN
    phase = np.where(near, np.where(turning, CORNERING, FOLLOWING), SEARCHING)
    return np.where(trajectory.contact, CRASHED, phase)


def _turn(trajectory: Trajectory) -> np.ndarray:
    """Net turn in the CORNERING_TIME around each row [rad], `(T + 1,)`."""
    time, yaw = trajectory.time, np.unwrap(trajectory.pose[:, 2])
    # beyond both ends, the yaw stays the same
    before, after = (
        np.interp(time + side * CORNERING_TIME / 2, time, yaw) for side in (-1, 1)
    )
    return after - before
