"""Fitting: sensor gains, wheel radii and track from measurements.

Values that no e-puck has are refused, since a measurement must be wrong.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from epuck_mj.constants import BODY_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import proximity

RADII = (0.015, 0.025)
TRACKS = (0.045, 0.065)
"""Radii and tracks that e-pucks can have [m].

Chosen: 20 % and more beyond any known.
"""

GAINS = (0.2, 5.0)
"""Gains that sensors can have. Chosen: known ones are 0.6 to 1.5."""

SIDES = ("left", "right")
"""The wheels in their order."""

SATURATED = 3700
"""Counts from which a sensor is saturated.

Chosen: sensors that touch a wall read 3775 to 3863. JBOTEVOLVER.
"""

FLOOR_MAX = 30
"""Most counts of a sensor that sees nothing, if its zero is set. Chosen."""

WINDOW = math.radians(6)
"""Turn in which a sensor faces a wall squarely [rad].

The ray is less than 0.1 mm longer at its ends, at a clearance of 30 mm.
"""

N_READINGS = 3
"""Fewest readings in a window."""


@dataclass(frozen=True, eq=False)
class SensorFit:
    """Gains and residuals of the sensors, against the mean sensor.

    Attributes:
        gains: of each sensor, `(8,)`.
        residuals: root mean square of what is left, relative to the counts, `(8,)`.
        used: whether a peak went into the fit, `(distances, 8)`; saturated ones do not.
    """

    gains: np.ndarray
    residuals: np.ndarray
    used: np.ndarray


def peaks(yaw: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Counts of each sensor while it faced the wall squarely, `(8,)`.

    The highest of the medians of readings that are close together: single readings may
    be wrong, and the highest of many noisy ones is too high.

    The sensors sit on the shell's rim and look away from the axle's middle, about which
    a robot with equal wheels turns: so a ray is shortest where it meets the wall
    squarely, and then as long as the clearance. Where directions and places are
    published apart, they differ by up to 3 degrees, which makes that less than 0.1 mm.
    WEBOTS.

    Args:
        yaw: of the robot at each reading, not wrapped [rad], `(n,)`.
        counts: `(n, 8)`, of a full turn or more.

    Raises:
        UserError: if readings are too far apart, or a sensor sees something everywhere.
    """
    _refuse_high_floor(np.median(counts, axis=0))
    first, last = yaw.min() + WINDOW / 2, yaw.max() - WINDOW / 2
    windows = [np.abs(yaw - middle) <= WINDOW / 2 for middle in yaw]
    medians = [
        np.median(counts[near], axis=0)
        for middle, near in zip(yaw, windows, strict=True)
        if first <= middle <= last and near.sum() >= N_READINGS
    ]
    if not medians:
        most = max(int(near.sum()) for near in windows)
        raise UserError(
            f"expected {N_READINGS} readings in {math.degrees(WINDOW):.0f} degrees of "
            f"turn, got {most}: the link is too slow"
        )
    return np.max(medians, axis=0)


def fit_gains(clearances: np.ndarray, counts: np.ndarray) -> SensorFit:
    """Gains with which the mean sensor's curve comes closest to the peaks.

    Least squares in the logarithm: of a factor that is the same at all distances, the
    mean of what the peaks say.

    Args:
        clearances: between shell and wall [m], `(distances,)`.
        counts: peaks, `(distances, 8)`.

    Raises:
        UserError: if a sensor was always saturated, or no e-puck has such gains.
    """
    mean_sensor = proximity(clearances)[:, None]
    used = counts < SATURATED
    n_used = used.sum(axis=0)
    if not n_used.all():
        names = ", ".join(f"ps{number}" for number in np.flatnonzero(n_used == 0))
        raise UserError(
            f"expected a peak below {SATURATED} counts of each sensor at some "
            f"distance, got none of {names}"
        )
    logs = np.where(used, np.log(np.maximum(counts, 1.0) / mean_sensor), 0.0)
    fitted = logs.sum(axis=0) / n_used
    left = np.where(used, logs - fitted, 0.0)
    gains = np.exp(fitted)
    for number, gain in enumerate(gains):
        refuse_outside(f"the gain of ps{number}", float(gain), GAINS, "")
    return SensorFit(gains, np.sqrt((left**2).sum(axis=0) / n_used), used)


def fit_wheel_radii(
    steps: float, forward: float, left: float, track: float
) -> tuple[float, float]:
    """Radii of the left and the right wheel [m], from a straight drive.

    The front, which is what a person sees, is a body's radius ahead of the axle: if the
    robot turned by `a`, it lies `tan(a / 2) = left / (forward + 2 BODY_RADIUS)` aside.

    Args:
        steps: that each motor made.
        forward: from where the front was to where it is, straight on [m].
        left: how far its front is to the left of straight on [m].
        track: effective distance of the wheels [m].

    Raises:
        UserError: if no e-puck has such wheels.
    """
    turn = 2 * math.atan2(left, forward + 2 * BODY_RADIUS)
    ahead = forward + BODY_RADIUS * (1 - math.cos(turn))
    chord = math.hypot(ahead, left - BODY_RADIUS * math.sin(turn))
    arc = chord / np.sinc(turn / (2 * np.pi))
    angle = steps * STEP_ANGLE
    wheels = [float(arc + side * turn * track / 2) / angle for side in (-1, 1)]
    return checked_wheel_radii(wheels)


def checked_wheel_radii(radii: Sequence[float]) -> tuple[float, float]:
    """Radii of the left and the right wheel [m] as given, if an e-puck can have them.

    Raises:
        UserError: if not.
    """
    for name, radius in zip(SIDES, radii, strict=True):
        what = f"a radius of the {name} wheel"
        refuse_outside(what, 1000 * radius, _millimetres(RADII), " mm")
    return radii[0], radii[1]


def fit_track(steps: float, wheel_radius: float, angle: float) -> float:
    """Effective distance of the wheels [m].

    Args:
        steps: that each motor made, one forward, one backward.
        wheel_radius: [m].
        angle: by which the robot turned on the spot [rad].

    Raises:
        UserError: if no e-puck has such a track.
    """
    if angle <= 0:
        raise UserError(f"expected a turn to the left, got {math.degrees(angle):.0f}")
    track = 2 * steps * STEP_ANGLE * wheel_radius / angle
    refuse_outside("a track", 1000 * track, _millimetres(TRACKS), " mm")
    return track


def refuse_outside(
    what: str, value: float, limits: tuple[float, float], unit: str
) -> None:
    """Refuse a measurement beyond limits.

    Args:
        what: was measured.
        value: that came of it.
        limits: lowest and highest value that an e-puck can have.
        unit: of them, with a space before it.

    Raises:
        UserError: if it is beyond them.
    """
    low, high = limits
    if not low <= value <= high:
        raise UserError(
            f"expected {what} from {low:g} to {high:g}{unit}, "
            f"measured {value:.3g}{unit}"
        )


def _refuse_high_floor(floor: np.ndarray) -> None:
    """Refuse counts that are too high away from the wall."""
    if floor.max() > FLOOR_MAX:
        raise UserError(
            f"expected up to {FLOOR_MAX} counts away from the wall, "
            f"got {floor.max():.0f} of ps{floor.argmax()}: "
            "the zero is not set, or something else is near"
        )


def _millimetres(limits: tuple[float, float]) -> tuple[float, float]:
    return 1000 * limits[0], 1000 * limits[1]
