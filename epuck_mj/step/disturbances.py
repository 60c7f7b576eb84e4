"""Disturbances: how a robot differs from the nominal one, and its noise.

Plain arrays, drawn before a trial begins: so a trial in them can be repeated, and all
individuals of a generation can meet the same ones.
"""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from epuck_mj.constants import (
    BODY_RADIUS,
    N_PROXIMITY,
    N_WHEELS,
    PROXIMITY_PERIOD,
    TRACK,
    WHEEL_RADIUS,
)
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.calibration import Calibration


@dataclass(frozen=True)
class Noise:
    """How strongly a robot is disturbed while it drives.

    Attributes:
        counts: standard deviation of proximity counts, in units of the published one.
        wheels: relative standard deviation of a wheel's speed in a control step.
        age: of the oldest proximity reading [s].
    """

    counts: float
    wheels: float
    age: float = PROXIMITY_PERIOD


NOISE: dict[str, Noise | None] = {
    "none": None,
    "calibrated": Noise(counts=1.0, wheels=0.03),
    "strong": Noise(counts=3.0, wheels=0.06),
}
"""Levels by name; without noise, sensors and motors are the paper's ideal ones.

Source: counts as measured on real robots (`PROXIMITY_COUNT_NOISE`); wheels as in Enki,
whose uniform 5 % have a standard deviation of 3 %.
"""


@dataclass(frozen=True)
class Ranges:
    """Ranges in which robots differ, lowest and highest.

    Attributes:
        gain: counts of a proximity sensor against the mean one's.
        wheel_radius: [m].
        track: effective distance of the wheels [m].
        mass: against the robot's own.
        friction: of wheels and floor, against the robot's own.
        latency: control steps until a command has reached the wheels.
        body_radius: of the shell [m]; the sensors sit on it.
        set_back: how far behind the shell they sit [m].
        light: counts of all sensors of a robot, by ambient light and the walls' colour.
        battery: speed of both wheels, against that of a full battery.
        slipping: control steps in which the tyres slip at the start of a trial.
        grip: share of the wheels' speed that the robot moves with in these.
    """

    gain: tuple[float, float] = (1.0, 1.0)
    wheel_radius: tuple[float, float] = (WHEEL_RADIUS, WHEEL_RADIUS)
    track: tuple[float, float] = (TRACK, TRACK)
    mass: tuple[float, float] = (1.0, 1.0)
    friction: tuple[float, float] = (1.0, 1.0)
    latency: tuple[int, int] = (0, 0)
    body_radius: tuple[float, float] = (BODY_RADIUS, BODY_RADIUS)
    set_back: tuple[float, float] = (0.0, 0.0)
    light: tuple[float, float] = (1.0, 1.0)
    battery: tuple[float, float] = (1.0, 1.0)
    slipping: tuple[int, int] = (0, 0)
    grip: tuple[float, float] = (1.0, 1.0)


BOOK = Ranges()
"""Ranges with the nominal robot only."""

RANGES = Ranges(
    gain=(0.6, 1.5),
    wheel_radius=(0.0200, 0.0207),
    track=(0.051, 0.057),
    mass=(0.93, 1.07),
    friction=(0.7, 1.2),
    latency=(0, 3),
)
"""Ranges of randomised robots.

Source: gains of JBotEvolver's eight sensors; wheel radii of Webots and of ARGoS, as
driven; tracks of Enki and of a fit for ROS 2. Mass, friction and latency are chosen.
"""

ALL_RANGES = replace(
    RANGES,
    body_radius=(0.034, 0.037),
    set_back=(0.0, 0.002),
    light=(0.8, 1.25),
    battery=(0.9, 1.0),
    slipping=(0, 3),
    grip=(0.0, 1.0),
)
"""Ranges of robots that differ in all that real ones differ in.

Source: body radii of the maker and FARSA (35 mm), Webots' guide (35.5), ARGoS in 3D
(36.2), Webots' model and Enki (37); 34 mm is chosen. Enki's front sensors sit 2 mm
behind its shell. Nobody has published how light, batteries and starts differ: chosen.
"""


@dataclass(frozen=True, eq=False)
class Disturbances:
    """Disturbances of `(n,)` trials, each one of `(k,)`, which trials may share.

    Attributes:
        of: which of the `k` each trial meets, `(n,)`.
        gains: of the proximity sensors, `(k, 8)`.
        known_gains: what those who read the sensors take for their gains, `(k, 8)`.
        age: of their readings at the end of a control step [s], `(k, 8)`.
        count_noise: of each reading, in published standard deviations,
            `(k, steps + 1, 8)`.
        wheel_gains: of the wheels' speeds, `(k, 2)`: radii, and what else lasts.
        turn_gain: of the robot's turns, `(k,)`: the track.
        wheel_noise: of the wheels' speeds in each control step, `(k, steps, 2)`.
        latency: control steps until a command has reached the wheels, `(k,)`, int.
        mass: of the robot against its own, `(k,)`.
        friction: of its wheels against their own, `(k,)`.
        lag: of its drive's time constants against their own, `(k,)`.
        wider: how much larger the radius of its shell is than its own [m], `(k,)`.
        set_back: how much farther behind the shell its sensors are [m], `(k,)`.
    """

    of: np.ndarray
    gains: np.ndarray
    known_gains: np.ndarray
    age: np.ndarray
    count_noise: np.ndarray
    wheel_gains: np.ndarray
    turn_gain: np.ndarray
    wheel_noise: np.ndarray
    latency: np.ndarray
    mass: np.ndarray
    friction: np.ndarray
    lag: np.ndarray
    wider: np.ndarray
    set_back: np.ndarray

    def __post_init__(self) -> None:
        """Refuse arrays that do not belong together."""
        k, steps = self.wheel_noise.shape[:2]
        expected = {
            "gains": (k, N_PROXIMITY),
            "known_gains": (k, N_PROXIMITY),
            "age": (k, N_PROXIMITY),
            "count_noise": (k, steps + 1, N_PROXIMITY),
            "wheel_gains": (k, N_WHEELS),
            "turn_gain": (k,),
            "wheel_noise": (k, steps, N_WHEELS),
            "latency": (k,),
            "mass": (k,),
            "friction": (k,),
            "lag": (k,),
            "wider": (k,),
            "set_back": (k,),
        }
        for name, shape in expected.items():
            if (got := getattr(self, name).shape) != shape:
                raise ValueError(f"expected {name} of shape {shape}, got {got}")

    def __len__(self) -> int:
        """Number of trials."""
        return len(self.of)

    @property
    def bodies(self) -> Bodies:
        """Bodies of the robots of the trials, `(n,)`."""
        every = (self.mass, self.friction, self.lag, self.wider, self.set_back)
        return Bodies(*every)[self.of]

    def __getitem__(self, index: np.ndarray | slice) -> Self:
        """The disturbances of some trials, by numpy's indexing."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        return type(self)(**{**arrays, "of": self.of[index]})

    def renew(self, which: np.ndarray, others: Self) -> None:
        """Replace the disturbances of some trials, in the arrays.

        Args:
            which: numbers of these trials, `(m,)`.
            others: their new ones, `(m,)`.

        Raises:
            ValueError: if trials share disturbances.
        """
        if not np.array_equal(self.of, np.arange(len(self.gains))):
            raise ValueError("expected a trial to share its disturbances with no other")
        for field in fields(self):
            if field.name != "of":
                getattr(self, field.name)[which] = getattr(others, field.name)[
                    others.of
                ]

    def tiled(self, times: int) -> Self:
        """The disturbances repeated for each of `times` individuals."""
        return self[np.tile(np.arange(len(self)), times)]


def draw_disturbances(
    rng: np.random.Generator,
    n: int,
    steps: int,
    noise: Noise,
    ranges: Ranges = BOOK,
) -> Disturbances:
    """Draw disturbances of `n` trials, independently for each.

    Args:
        rng: where they come from.
        n: number of trials.
        steps: control steps of a trial.
        noise: how strong.
        ranges: how robots differ.
    """
    low, high = np.log(ranges.gain)
    drawn = Disturbances(
        of=np.arange(n),
        # a gain of 2 is as likely as a gain of 1/2
        gains=np.exp(rng.uniform(low, high, (n, N_PROXIMITY))),
        known_gains=np.ones((n, N_PROXIMITY)),
        age=rng.uniform(0, noise.age, (n, N_PROXIMITY)),
        count_noise=noise.counts * rng.standard_normal((n, steps + 1, N_PROXIMITY)),
        wheel_gains=rng.uniform(*ranges.wheel_radius, (n, N_WHEELS)) / WHEEL_RADIUS,
        turn_gain=TRACK / rng.uniform(*ranges.track, n),
        wheel_noise=noise.wheels * rng.standard_normal((n, steps, N_WHEELS)),
        latency=rng.integers(ranges.latency[0], ranges.latency[1] + 1, n),
        mass=rng.uniform(*ranges.mass, n),
        friction=rng.uniform(*ranges.friction, n),
        lag=np.ones(n),
        wider=np.zeros(n),
        set_back=np.zeros(n),
    )
    # drawn last, and only if they differ: the rest stays what it is without them
    wider = _uniform(rng, ranges.body_radius, n) - BODY_RADIUS
    set_back = _uniform(rng, ranges.set_back, n)
    dark, bright = np.log(ranges.light).tolist()
    light = np.exp(_uniform(rng, (dark, bright), n))
    battery = _uniform(rng, ranges.battery, n)
    slipping = rng.integers(ranges.slipping[0], ranges.slipping[1] + 1, n)
    grip = _uniform(rng, ranges.grip, n)
    return replace(
        drawn,
        gains=drawn.gains * light[:, None],
        wheel_gains=drawn.wheel_gains * battery[:, None],
        wheel_noise=with_slipping_start(
            drawn.wheel_noise, drawn.latency, slipping, grip
        ),
        wider=wider,
        set_back=set_back,
    )


def with_slipping_start(
    wheel_noise: np.ndarray, latency: np.ndarray, slipping: np.ndarray, grip: np.ndarray
) -> np.ndarray:
    """Noise of wheels `(n, steps, 2)` whose tyres slip when a trial begins.

    To the robot, a wheel that slips is one that turns less.

    Args:
        wheel_noise: without slipping.
        latency: control steps until the first command has arrived, `(n,)`.
        slipping: control steps that the tyres slip from then on, `(n,)`.
        grip: share of the wheels' speed that the robot moves with in these, `(n,)`.
    """
    k = np.arange(wheel_noise.shape[1])
    begins, ends = latency[:, None], (latency + slipping)[:, None]
    slips = (k >= begins) & (k < ends)
    less = grip[:, None, None] * (1 + wheel_noise) - 1
    return np.where(slips[..., None], less, wheel_noise)


def _uniform(rng: np.random.Generator, ends: tuple[float, float], n: int) -> np.ndarray:
    """Numbers `(n,)` between two ends; without a draw if these are the same."""
    low, high = ends
    return np.full(n, low) if low == high else rng.uniform(low, high, n)


def draw_calibrated(
    calibration: Calibration,
    rng: np.random.Generator,
    n: int,
    steps: int,
    noise: Noise,
) -> Disturbances:
    """Draw disturbances of `n` trials of one calibrated robot.

    As on the bridge, its sensors' gains are undone, and its wheels' are not.

    Args:
        calibration: of that robot.
        rng: where its noise comes from.
        n: number of trials.
        steps: control steps of a trial.
        noise: how strong.
    """
    gains = np.tile(calibration.gains, (n, 1))
    wheels = np.array(calibration.wheel_radii) / WHEEL_RADIUS
    return replace(
        draw_disturbances(rng, n, steps, noise),
        gains=gains,
        known_gains=gains,
        wheel_gains=np.tile(wheels, (n, 1)),
        turn_gain=np.full(n, TRACK / calibration.track),
        latency=np.full(n, calibration.latency),
        lag=np.full(n, calibration.lag),
    )
