"""Quantities: how well a robot explains a drive, before its fit and after it."""

from dataclasses import dataclass

import numpy as np

from epuck_mj.calibrate.command_delay import told_steps
from epuck_mj.calibrate.drive_model import DriveModel
from epuck_mj.calibrate.parameters import GAINS
from epuck_mj.calibrate.recorded_drive import RecordedDrive
from epuck_mj.calibrate.smoothing import Smoothed
from epuck_mj.constants import N_PROXIMITY
from epuck_mj.step.sensors import sensed_distance


@dataclass(frozen=True)
class Quantity:
    """Differences between what was recorded and what a robot would give.

    Attributes:
        name: of it.
        unit: of what is left.
        n: how often it was recorded.
        before: root mean square of what the known robot leaves.
        after: of what the fitted one leaves.
    """

    name: str
    unit: str
    n: int
    before: float
    after: float


def motor_steps(drive: RecordedDrive, before: int, after: int) -> Quantity:
    """Steps of the counters that commands do not explain, for two latencies."""
    made = np.diff(drive.steps, axis=0)
    left = [
        made - told_steps(drive, latency * drive.control_step)
        for latency in (before, after)
    ]
    return Quantity(
        "motor steps in a control step", "steps", made.size, *map(_rms, left)
    )


def paths(
    model: DriveModel, before: Smoothed, after: Smoothed
) -> tuple[Quantity, Quantity]:
    """Poses from the counters alone, compared with poses that the walls show."""
    ways, turns = [], []
    for each in (before, after):
        path = model.path(after.poses[0], each.parameters)
        off = path - after.poses
        ways.append(1000 * _rms(np.hypot(off[:, 0], off[:, 1])))
        turns.append(float(np.degrees(_rms(off[:, 2]))))
    n = len(after.poses)
    return (
        Quantity("path by the counters alone", "mm", n, *ways),
        Quantity("heading by the counters alone", "degrees", n, *turns),
    )


def readings(
    model: DriveModel, before: Smoothed, after: Smoothed, near: np.ndarray
) -> list[Quantity]:
    """Distances from the sensors, compared with those to the arena's walls."""
    left = [
        sensed_distance(model.drive.counts, np.exp(each.parameters[GAINS]))
        - model.distances(each.poses)
        for each in (before, after)
    ]
    return [
        Quantity(
            f"distance by ps{i}",
            "mm",
            int(near[:, i].sum()),
            *(1000 * _rms(each[near[:, i], i]) for each in left),
        )
        for i in range(N_PROXIMITY)
    ]


def _rms(values: np.ndarray) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt((values**2).mean())) if values.size else float("nan")
