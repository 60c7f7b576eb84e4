"""Model of a drive: how poses, wheels and sensors explain what was recorded.

The unknowns are the pose at each reading, and the parameters of the robot. Between two
readings the counters say how the robot moved; at each reading the walls of the arena
say, through the sensors, where it was. What both leave is divided by what it may be.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from epuck_mj.calibrate.command_delay import lagged_rates
from epuck_mj.calibrate.fitting import SATURATED
from epuck_mj.calibrate.parameters import (
    GAINS,
    LAG,
    LEFT,
    N_PARAMETERS,
    OWN_TRACK,
    RIGHT,
    ahead_and_around,
    step_lengths,
    track,
)
from epuck_mj.calibrate.recorded_drive import RecordedDrive
from epuck_mj.constants import PROXIMITY_PERIOD, TRACK, WHEEL_RADIUS
from epuck_mj.rungs.kinematic.kernel import N_OWN
from epuck_mj.rungs.kinematic.plan import Plan
from epuck_mj.rungs.kinematic.robots import at_rest, sensed
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import (
    COUNT_NOISE,
    LOG_COUNTS,
    NOISE_DISTANCES,
    PROXIMITY_DISTANCES,
    sensed_distance,
)

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

ASIDE = 0.0001
"""Standard deviation of slip to the side in a control step [m]. Chosen."""

BENT = 0.03
"""Part of way times turn by which a path may differ from two arcs. Chosen."""

NUDGE, LAG_NUDGE = 1e-6, 1e-4
"""Change of poses [m, rad] and of the lag by which slopes are measured."""

STILL = 1e-3
"""Change of speed [m/s] below which a wheel's is constant: a motor's is a hundredth."""


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
class Wheels:
    """What the wheels do with a lag, ahead and around: first axes of 2.

    Attributes:
        ways: steps that count between readings, `(2, T, 2)`: a body that lags is behind
            its counters by its lag's worth of way, and what old readings saw is behind
            by their age's.
        rates: at the readings [steps/s], `(2, T + 1, 2)`.
    """

    ways: np.ndarray
    rates: np.ndarray


@dataclass(frozen=True, eq=False)
class DriveModel:
    """A recorded drive in an arena, or a part of it.

    Attributes:
        drive: what was recorded.
        plan: of robot and arena.
        delay: of commands [s].
        slip: relative standard deviation of a wheel's way in a control step.
        first: first reading of the part.
        last: last one.
    """

    drive: RecordedDrive
    plan: Plan
    delay: float
    slip: float
    first: int
    last: int
    _wheels: dict[float, Wheels] = field(default_factory=dict)

    def part(self, first: int, last: int) -> "DriveModel":
        """The model of the readings from `first` to `last`."""
        return replace(self, first=first, last=last)

    @property
    def time(self) -> np.ndarray:
        """Of the readings [s], `(T + 1,)`."""
        return self.drive.time[self.first : self.last + 1]

    def wheels(self, lag: float) -> Wheels:
        """What the wheels do with a lag, given as a multiple of the nominal one."""
        if lag not in self._wheels:
            # a fit comes back to few
            if len(self._wheels) > 20:
                self._wheels.clear()
            rates, ways = [], []
            for nominal in self.plan.lag.tolist():
                time = max(lag, 1e-3) * nominal
                rates.append(lagged_rates(self.drive, self.delay, time))
                behind = (lag * nominal + MEAN_AGE) * rates[-1]
                ways.append(np.diff(self.drive.steps - behind, axis=0))
            self._wheels[lag] = Wheels(np.array(ways), np.array(rates))
        whole = self._wheels[lag]
        return Wheels(
            whole.ways[:, self.first : self.last],
            whole.rates[:, self.first : self.last + 1],
        )

    def moved(self, parameters: np.ndarray) -> np.ndarray:
        """Way ahead [m] and turn [rad] between readings by the counters, `(T, 2)`."""
        return ahead_and_around(self.wheels(float(parameters[LAG])).ways, parameters)

    def shifts(self, parameters: np.ndarray) -> np.ndarray:
        """What a path between readings is beside an arc's chord [m], `(T, 2)`: x, y.

        A command changes the speeds somewhere between two readings. So there are two
        arcs, the first with the speeds at its start; x is the chord's direction.
        """
        wheels = self.wheels(float(parameters[LAG]))
        moved = ahead_and_around(wheels.ways, parameters)
        speeds = ahead_and_around(wheels.rates, parameters)
        before, change = speeds[:-1], np.diff(speeds, axis=0)
        period = np.diff(self.time)[:, None]
        # by whichever changes more, as wheels feel it
        feels = np.abs(change * (1.0, TRACK / 2))
        column = feels.argmax(axis=1)[:, None]
        top = np.take_along_axis(before + change - moved / period, column, 1)
        bottom = np.take_along_axis(change, column, 1)
        still = np.take_along_axis(feels, column, 1) < STILL
        share = np.where(still, 0.0, top / np.where(still, 1.0, bottom))
        first = before * period * np.clip(share, 0.0, 1.0)
        second = moved - first
        found = np.zeros(moved.shape)
        for arc, middle in (
            (first, (first[:, 1] - moved[:, 1]) / 2),
            (second, (moved[:, 1] - second[:, 1]) / 2),
        ):
            chord = _chord(arc)
            found += np.stack([chord * np.cos(middle), chord * np.sin(middle)], -1)
        found[:, 0] -= _chord(moved)
        return found

    def path(self, start: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Poses `(T + 1, 3)` by the counters alone, from a start `(3,)`."""
        moved, shifts = self.moved(parameters), self.shifts(parameters)
        yaw = start[2] + np.concatenate([[0.0], np.cumsum(moved[:, 1])])
        ahead, aside = _chord(moved) + shifts[:, 0], shifts[:, 1]
        middle = yaw[:-1] + moved[:, 1] / 2
        cos, sin = np.cos(middle), np.sin(middle)
        x = start[0] + np.concatenate([[0.0], np.cumsum(ahead * cos - aside * sin)])
        y = start[1] + np.concatenate([[0.0], np.cumsum(ahead * sin + aside * cos)])
        return np.stack([x, y, yaw], axis=-1)

    def distances(self, poses: np.ndarray) -> np.ndarray:
        """Length of each ray from poses `(n, 3)`, at most SIGHT [m], `(n, 8)`."""
        # sensors are where the plan has them
        own = np.zeros((len(poses), N_OWN))
        found = sensed(self.plan, at_rest(poses), own, SIGHT)
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
        longer, beside = self.shifts(parameters).T
        # by x, y, half of the yaws' sum, their difference
        slopes = np.zeros((3, n, 4))
        slopes[0] = np.stack([cos * bend, sin * bend, aside * bend, way * turn / 12], 1)
        slopes[1, :, 3] = 1.0
        slopes[2, :, :3] = np.stack([-sin, cos, -ahead], axis=-1)
        left = np.stack([ahead * bend - longer - way, turned - turn, aside - beside])
        # by the parameters
        by = np.zeros((3, n, N_PARAMETERS))
        own = self.wheels(float(parameters[LAG])).ways * step_lengths(parameters)
        by[0][:, [LEFT, RIGHT]] = -own[0] / 2
        by[1][:, [LEFT, RIGHT]] = own[1] * (1, -1) / track(parameters)
        by[1][:, OWN_TRACK] = turn
        other = parameters + LAG_NUDGE * (np.arange(N_PARAMETERS) == LAG)
        by[:2, :, LAG] = -(self.moved(other) - self.moved(parameters)).T / LAG_NUDGE
        # what slips are the wheels
        basis = np.array([[1, -TRACK / 2, 0], [1, TRACK / 2, 0], [0, 0, 1]])
        deviations = self._deviations(way, turn)
        scale = 1 / deviations
        left, slopes, by = (
            np.einsum("ij,jk...->ki...", basis, each) for each in (left, slopes, by)
        )
        left = scale * left
        slopes, by = scale[..., None] * slopes, scale[..., None] * by
        half = slopes[..., 2] / 2
        before = np.stack([-slopes[..., 0], -slopes[..., 1], half - slopes[..., 3]], -1)
        after = np.stack([slopes[..., 0], slopes[..., 1], half + slopes[..., 3]], -1)
        return left, before, after, by, float(np.log(deviations[:, :2]).sum())

    def _deviations(self, way: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Standard deviations of the ways of both wheels, and aside [m], `(T, 3)`."""
        wheels = np.stack([way - turn * TRACK / 2, way + turn * TRACK / 2], axis=-1)
        whole = WHOLE_STEP * STEP_ANGLE * WHEEL_RADIUS
        aside = np.hypot(ASIDE, BENT * way * turn)
        return np.column_stack([np.hypot(whole, self.slip * wheels), aside])

    def _seen(
        self, poses: np.ndarray, parameters: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        counts = self.drive.counts[self.first : self.last + 1]
        gains = parameters[GAINS]
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
        noise = np.interp(known, NOISE_DISTANCES, COUNT_NOISE) / used
        speed = np.gradient(poses, self.time, axis=0)
        closing = np.einsum("kip,kp->ki", slopes, speed)
        aged = AGE_SPREAD * closing * steepness
        deviation = np.sqrt(noise**2 + CURVE_ERROR**2 + np.minimum(aged**2, 1.0))
        scale = np.where(silent, 0.0, 1 / deviation)
        by_pose = -(scale * steepness)[..., None] * slopes
        return scale * left, by_pose, -scale


def _chord(arcs: np.ndarray) -> np.ndarray:
    """Chords [m], `(n,)`, of arcs `(n, 2)`: their way [m] and turn [rad]."""
    return arcs[:, 0] * np.sinc(arcs[:, 1] / (2 * np.pi))


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
