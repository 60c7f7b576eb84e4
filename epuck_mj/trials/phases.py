"""Phases: what a robot is about at each moment of a trial, by true geometry."""

import numpy as np

from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.trials.trajectory import Trajectory

SEARCHING, FOLLOWING = "searching", "following"
CORNERING, CRASHED = "cornering", "crashed"
"""Away from walls; near one; near one and turning; in one."""

CORNERING_TIME = 1.0
"""Time around a moment in which a turn is looked at [s]: no wiggle counts."""

CORNERING_TURN = np.pi / 6
"""Least net turn in that time of a robot that takes a corner [rad].

At full speed, a wall of less than a quarter of a metre radius.
"""


def phases(trajectory: Trajectory, clearance: np.ndarray) -> np.ndarray:
    """Phase of each row of what is sensed, `(T + 1,)`.

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
    # the ends stand still
    before, after = (
        np.interp(time + side * CORNERING_TIME / 2, time, yaw) for side in (-1, 1)
    )
    return after - before
