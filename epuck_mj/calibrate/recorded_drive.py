"""Recorded drives: what the log of a robot holds for a fit, checked."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.step.motors import STEP_ANGLE, step_rates
from epuck_mj.trials.trajectory import Trajectory

STEPS_MIN = 50
"""Fewest control steps of a drive that can be fitted. Chosen."""


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """What a robot was told, did and sensed in `T` control steps.

    Attributes:
        time: of the readings, from 0 [s], `(T + 1,)`.
        steps: that the motors had made by then, left and right, `(T + 1, 2)`.
        rates: told after each reading but the last [steps/s], `(T, 2)`.
        counts: of the proximity sensors, `(T + 1, 8)`; NaN where there is none.
        start: pose as logged, `(3,)`: x, y [m], yaw [rad].
    """

    time: np.ndarray
    steps: np.ndarray
    rates: np.ndarray
    counts: np.ndarray
    start: np.ndarray

    @property
    def control_step(self) -> float:
        """Its usual duration [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def way(self) -> float:
        """Mean angle by which the wheels turned, in either direction [rad]."""
        return float(np.abs(np.diff(self.steps, axis=0)).mean(axis=1).sum()) * (
            STEP_ANGLE
        )


def load_drive(path: Path, start: np.ndarray | None = None) -> RecordedDrive:
    """The drive in a log of the bridge.

    Args:
        path: of the .npz file.
        start: pose `(3,)`: x, y [m], yaw [rad]; the log's if None.

    Raises:
        UserError: if it is no log of a robot, or too short.
    """
    log = Trajectory.load(path)
    if log.motor_steps is None:
        raise UserError(
            f"'{path}' has no motor_steps: expected the log of a drive by "
            "python -m epuck_mj.bridge, not of a simulation or of an older version"
        )
    if log.steps < STEPS_MIN:
        raise UserError(
            f"'{path}': expected at least {STEPS_MIN} control steps, got {log.steps}"
        )
    forward = np.isfinite(log.time).all() and (np.diff(log.time) > 0).all()
    for name, good in (
        ("time that grows", forward),
        ("motor_steps that are finite", np.isfinite(log.motor_steps).all()),
        ("command that is finite", np.isfinite(log.command).all()),
        ("a pose that is finite at its start", np.isfinite(log.pose[0]).all()),
    ):
        if not good:
            raise UserError(f"'{path}': expected {name}")
    return RecordedDrive(
        time=log.time - log.time[0],
        steps=log.motor_steps - log.motor_steps[0],
        rates=step_rates(log.command).astype(float),
        counts=log.proximity,
        start=log.pose[0] if start is None else start,
    )
