"""Model of a drive: how poses, wheels and sensors explain what was recorded.

The unknowns are the pose at each reading, and the parameters of the robot. Between two
readings the counters say how the robot moved; at each reading the walls of the arena
say, through the sensors, where it was. What both leave is divided by what it may be.
"""

from dataclasses import dataclass, field

import numpy as np

from epuck_mj.calibrate.command_delay import lagged_rates
from epuck_mj.calibrate.fitting import SATURATED
from epuck_mj.calibrate.recorded_drive import RecordedDrive
from epuck_mj.constants import N_PROXIMITY, PROXIMITY_PERIOD, TRACK, WHEEL_RADIUS
from epuck_mj.rungs.kinematic.kernel import sense_all
from epuck_mj.rungs.kinematic.plan import Plan
from epuck_mj.rungs.kinematic.robots import at_rest
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import (
    LOG_COUNTS,
    NOISE,
    NOISE_DISTANCES,
    PROXIMITY_DISTANCES,
    sensed_distance,
)

LEFT, RIGHT, OWN_TRACK, LAG = range(4)
GAINS = slice(4, 4 + N_PROXIMITY)
N_PARAMETERS = 4 + N_PROXIMITY
"""Places in the parameters: logarithms of wheel radii, track and gains against the
nominal robot's, and its lag."""

FAR = 30.0
"""Counts below which a sensor says no more than that nothing is near.

Chosen: as many as `FLOOR_MAX`, and 15 standard deviations of their noise.
"""

SIGHT = 0.5
"""How far rays are followed [m]: farther walls are as good as none."""

CURVE_END = 0.08
"""Distance [m] beyond which counts are not used, so that only their slope matters."""

POWER = -2.23
"""Exponent of counts by distance beyond that: a fit to those of 1 to 8 cm."""

CURVE_ERROR = 0.02
"""Relative error of the mean sensor's curve. Chosen: of its interpolation."""

MEAN_AGE = PROXIMITY_PERIOD / 2
AGE_SPREAD = PROXIMITY_PERIOD / 12**0.5
"""Mean and standard deviation of the age of a reading [s], if any is as likely."""

WHOLE_STEP = 6**-0.5
"""Standard deviation of a difference of two counters, which are whole [steps]."""

ASIDE = 0.0002
"""Standard deviation of slip to the side in a control step [m]. Chosen."""

BENT = 0.1
"""Part of its lateral way by which a path may differ from an arc. Chosen."""

NUDGE = 1e-6
"""Change of poses [m, rad] by which slopes of rays are measured."""


def parameters_of(calibration: Calibration) -> np.ndarray:
    """Parameters `(12,)` of a calibrated robot."""
    found = np.zeros(N_PARAMETERS)
    radii = np.array(calibration.wheel_radii)
    found[[LEFT, RIGHT]] = np.log(radii / WHEEL_RADIUS)
    found[OWN_TRACK] = np.log(calibration.track / TRACK)
    found[LAG] = calibration.lag
    found[GAINS] = np.log(calibration.gains)
    return found


@dataclass(frozen=True, eq=False)
class Linearised:
    """Residuals and their slopes, each divided by its standard deviation.

    Attributes:
        motion: left wheel, right wheel, aside, `(T, 3)`.
        motion_from: slopes by the pose before, `(T, 3, 3)`.
        motion_to: by the pose after it, `(T, 3, 3)`.
        motion_parameters: by the parameters, `(T, 3, 12)`.
        seen: of the sensors' logarithms of counts, `(T + 1, 8)`.
        seen_pose: slopes by the pose, `(T + 1, 8, 3)`.
        seen_gains: by the logarithm of the gain of the same sensor, `(T + 1, 8)`.
        log_scales: sum of the logarithms of the motion's standard deviations.
    """

    motion: np.ndarray
    motion_from: np.ndarray
    motion_to: np.ndarray
    motion_parameters: np.ndarray
    seen: np.ndarray
    seen_pose: np.ndarray
    seen_gains: np.ndarray
    log_scales: float


@dataclass(frozen=True, eq=False)
class DriveModel:
    """A recorded drive in an arena.

    Attributes:
        drive: what was recorded.
        plan: of robot and arena.
        delay: of commands [s].
        slip: relative standard deviation of a wheel's way in a control step.
    """

    drive: RecordedDrive
    plan: Plan
    delay: float
    slip: float
    _ways: dict[float, np.ndarray] = field(default_factory=dict)

    def until(self, n: int) -> "DriveModel":
        """The model of the first `n` readings."""
        whole = self.drive
        part = RecordedDrive(
            whole.time[:n], whole.steps[:n], whole.rates[: n - 1], whole.counts[:n],
            whole.start,
        )  # fmt: skip
        ways = {lag: way[:, : n - 1] for lag, way in self._ways.items()}
        return DriveModel(part, self.plan, self.delay, self.slip, ways)

    def ways(self, lag: float) -> np.ndarray:
        """Steps that count between readings, ahead and around, `(2, T, 2)`.

        A body that lags is behind its counters by its lag's worth of way, and what old
        readings saw is behind by their age's.
        """
        if lag not in self._ways:
            # a fit comes back to few
            if len(self._ways) > 50:
                self._ways.clear()
            found = []
            for nominal in self.plan.lag.tolist():
                time = max(lag, 1e-3) * nominal
                rates = lagged_rates(self.drive, self.delay, time)
                behind = (lag * nominal + MEAN_AGE) * rates
                found.append(np.diff(self.drive.steps - behind, axis=0))
            self._ways[lag] = np.array(found)
        return self._ways[lag]

    def moved(self, parameters: np.ndarray) -> np.ndarray:
        """Way ahead [m] and turn [rad] between readings by the counters, `(T, 2)`."""
        radii = STEP_ANGLE * WHEEL_RADIUS * np.exp(parameters[[LEFT, RIGHT]])
        ahead, around = self.ways(float(parameters[LAG])) * radii
        track = TRACK * np.exp(parameters[OWN_TRACK])
        return np.stack(
            [ahead.mean(axis=-1), (around[:, 1] - around[:, 0]) / track], axis=-1
        )

    def path(self, start: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Poses `(T + 1, 3)` by the counters alone, from a start `(3,)`."""
        way, turn = self.moved(parameters).T
        yaw = start[2] + np.concatenate([[0.0], np.cumsum(turn)])
        chord, middle = way * np.sinc(turn / (2 * np.pi)), yaw[:-1] + turn / 2
        x = start[0] + np.concatenate([[0.0], np.cumsum(chord * np.cos(middle))])
        y = start[1] + np.concatenate([[0.0], np.cumsum(chord * np.sin(middle))])
        return np.stack([x, y, yaw], axis=-1)

    def distances(self, poses: np.ndarray) -> np.ndarray:
        """Length of each ray from poses `(n, 3)`, at most SIGHT [m], `(n, 8)`."""
        found = np.empty((len(poses), N_PROXIMITY))
        sense_all(self.plan, at_rest(poses), SIGHT, found)
        return np.where(found < 0, SIGHT, found)

    def linearised(self, poses: np.ndarray, parameters: np.ndarray) -> Linearised:
        """Residuals and slopes at poses `(T + 1, 3)` and parameters `(12,)`."""
        motion = self._motion(poses, parameters)
        return Linearised(*motion[:4], *self._seen(poses, parameters), motion[4])

    def _motion(
        self, poses: np.ndarray, parameters: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
        n = len(poses) - 1
        dx, dy, turned = np.diff(poses, axis=0).T
        middle = poses[:-1, 2] + turned / 2
        cos, sin = np.cos(middle), np.sin(middle)
        ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
        bend = 1 / np.sinc(turned / (2 * np.pi))
        way, turn = self.moved(parameters).T
        # by x, y, half of the yaws' sum, their difference
        slopes = np.zeros((3, n, 4))
        slopes[0] = np.stack([cos * bend, sin * bend, aside * bend, way * turn / 12], 1)
        slopes[1, :, 3] = 1.0
        slopes[2, :, :3] = np.stack([-sin, cos, -ahead], axis=-1)
        left = np.stack([ahead * bend - way, turned - turn, aside])
        # by the parameters
        by = np.zeros((3, n, N_PARAMETERS))
        radii = STEP_ANGLE * WHEEL_RADIUS * np.exp(parameters[[LEFT, RIGHT]])
        own = self.ways(float(parameters[LAG])) * radii
        track = TRACK * np.exp(parameters[OWN_TRACK])
        by[0][:, [LEFT, RIGHT]] = -own[0] / 2
        by[1][:, [LEFT, RIGHT]] = own[1] * (1, -1) / track
        by[1][:, OWN_TRACK] = turn
        other = parameters.copy()
        other[LAG] += 1e-4
        by[:2, :, LAG] = -(self.moved(other) - self.moved(parameters)).T / 1e-4
        # what slips are the wheels
        wheels = np.array([[1, -TRACK / 2, 0], [1, TRACK / 2, 0], [0, 0, 1]])
        deviation = self._deviations(way, turn)
        left, slopes, by = (
            np.einsum("ij,j...->i...", wheels, each) for each in (left, slopes, by)
        )
        scale = (1 / deviation).T
        left, slopes, by = (
            (scale.reshape(3, n, *(1,) * (each.ndim - 2)) * each).swapaxes(0, 1)
            for each in (left, slopes, by)
        )
        half = slopes[..., 2] / 2
        before = np.stack([-slopes[..., 0], -slopes[..., 1], half - slopes[..., 3]], -1)
        after = np.stack([slopes[..., 0], slopes[..., 1], half + slopes[..., 3]], -1)
        return left, before, after, by, float(np.log(deviation[:, :2]).sum())

    def _deviations(self, way: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Standard deviations of the ways of both wheels, and aside [m], `(T, 3)`."""
        wheels = np.stack([way - turn * TRACK / 2, way + turn * TRACK / 2], axis=-1)
        whole = WHOLE_STEP * STEP_ANGLE * WHEEL_RADIUS
        aside = np.hypot(ASIDE, BENT * way * turn)
        return np.column_stack([np.hypot(whole, self.slip * wheels), aside])

    def _seen(
        self, poses: np.ndarray, parameters: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        counts, gains = self.drive.counts, parameters[GAINS]
        distance = self.distances(poses)
        slopes = np.stack(
            [
                (self.distances(poses + nudge) - distance) / NUDGE
                for nudge in NUDGE * np.eye(3)
            ],
            axis=-1,
        )
        expected, steepness = curve(distance)
        expected = expected + gains
        used = np.clip(np.nan_to_num(counts, nan=FAR), FAR, SATURATED)
        left = np.log(used) - expected
        # where counts have no more to say, one side only
        silent = ((used <= FAR) & (left > 0)) | ((used >= SATURATED) & (left < 0))
        silent |= np.isnan(counts)
        known = sensed_distance(used, np.exp(gains))
        noise = np.interp(known, NOISE_DISTANCES, NOISE) / used
        speed = np.gradient(poses, self.drive.time, axis=0)
        closing = np.einsum("kip,kp->ki", slopes, speed)
        aged = AGE_SPREAD * closing * steepness
        deviation = np.sqrt(noise**2 + CURVE_ERROR**2 + np.minimum(aged**2, 1.0))
        scale = np.where(silent, 0.0, 1 / deviation)
        by_pose = -(scale * steepness)[..., None] * slopes
        return scale * left, by_pose, -scale


def curve(distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Logarithm of the mean sensor's counts at distances `(...)`, and its slope [1/m].

    Source: `PROXIMITY_COUNTS`; beyond CURVE_END a power of the distance.
    """
    near = np.clip(distance, 0.0, CURVE_END)
    i = np.searchsorted(PROXIMITY_DISTANCES, near, side="right") - 1
    i = np.minimum(i, len(LOG_COUNTS) - 2)
    slopes = np.diff(LOG_COUNTS) / np.diff(PROXIMITY_DISTANCES)
    logs = LOG_COUNTS[i] + slopes[i] * (near - PROXIMITY_DISTANCES[i])
    beyond = np.maximum(distance, CURVE_END)
    logs = logs + POWER * np.log(beyond / CURVE_END)
    return logs, np.where(distance < CURVE_END, slopes[i], POWER / beyond)
