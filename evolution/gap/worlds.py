"""Worlds: pseudo-realities, spread evenly over differences of robots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_mj.constants import (
    BODY_RADIUS,
    N_PROXIMITY,
    N_WHEELS,
    PROXIMITY_PERIOD,
    TRACK,
    WHEEL_RADIUS,
)
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.disturbances import ALL_RANGES, Disturbances, with_slipping_start
from evolution.settings.randomness import random_generator

WORLD_SEED = 0
"""Seed of the worlds, which are the same for all champions and studies."""

NOISE, STARTS = range(2)
"""What the randomness of a world is for."""


@dataclass(frozen=True)
class World:
    """A pseudo-reality.

    Attributes:
        kind: of the worlds it is one of, a name in `KINDS`.
        number: which of them it is.
        arena: shipped arena.
        period: duration of a control step [s]; the nearest that physics steps allow.
        curve: counts of all proximity sensors against the published ones.
        gain_spread: standard deviation of the logarithm of each sensor's gain.
        light: counts of all of them, by ambient light and the walls' colour.
        count_noise: in published standard deviations.
        wheel_radius: of both wheels [m].
        bias: of the left wheel's speed over the right one's.
        battery: speed of both wheels, against that of a full battery.
        track: effective distance of the wheels [m].
        slip: relative standard deviation of a wheel's speed in a control step.
        slipping: control steps in which the tyres slip at the start of a trial.
        grip: share of the wheels' speed that the robot moves with in these.
        latency: control steps until a command has reached the wheels.
        mass: of the robot against its own.
        friction: of its wheels against their own.
        body_radius: of its shell [m].
        set_back: how far its sensors are behind the shell [m].
    """

    kind: str
    number: int
    arena: str
    period: float
    curve: float
    gain_spread: float
    light: float
    count_noise: float
    wheel_radius: float
    bias: float
    battery: float
    track: float
    slip: float
    slipping: int
    grip: float
    latency: int
    mass: float
    friction: float
    body_radius: float
    set_back: float


LOGARITHMS = ("curve", "light")
"""Quantities whose logarithms are spread evenly: half as much is as likely as twice."""

WHOLE = ("latency", "slipping")
"""Quantities that are whole numbers."""

FIXED = ("grip",)
"""Quantities that have no values beyond their ranges."""

UPWARDS = ("gain_spread", "count_noise", "slip", "set_back", "latency", "slipping")
"""Quantities that are never less than 0."""

DOWNWARDS = ("battery",)
"""Quantities that are never more than 1."""

WORLD_RANGES: Mapping[str, tuple[float, float]] = {
    "period": (0.08, 0.12),
    "curve": (1 / 1.5, 1.5),
    "gain_spread": (0.0, 0.25),
    "light": ALL_RANGES.light,
    "count_noise": (0.0, 3.0),
    "wheel_radius": ALL_RANGES.wheel_radius,
    "bias": (-0.03, 0.03),
    "battery": ALL_RANGES.battery,
    "track": ALL_RANGES.track,
    "slip": (0.0, 0.06),
    "slipping": ALL_RANGES.slipping,
    "grip": ALL_RANGES.grip,
    "latency": ALL_RANGES.latency,
    "mass": ALL_RANGES.mass,
    "friction": ALL_RANGES.friction,
    "body_radius": ALL_RANGES.body_radius,
    "set_back": ALL_RANGES.set_back,
}
"""Lowest and highest values of all quantities.

Source: the figures of books and drivers differ by so much (those of randomised robots
in evolution), and so do the gains of eight sensors of two robots.
"""

ARENAS = ("arena", "small_square", "rectangle", "l_shape", "octagon")
CORNERS = ("convex_corner", "pillars", "corridor")


def half_as_wide_again(
    ranges: Mapping[str, tuple[float, float]],
) -> dict[str, tuple[float, float]]:
    """Ranges that are half as wide again, about the same middle where they can be."""
    found = {}
    for name, ends in ranges.items():
        low, high = np.log(ends) if name in LOGARITHMS else ends
        more = 0.0 if name in FIXED else 0.5 * (high - low)
        down, up = more / 2, more / 2
        if name in UPWARDS:
            down, up = 0.0, more
        if name in DOWNWARDS:
            down, up = more, 0.0
        wider = low - down, high + up
        wider = tuple(np.exp(wider).tolist()) if name in LOGARITHMS else wider
        found[name] = tuple(map(int, wider)) if name in WHOLE else wider
    return found


@dataclass(frozen=True)
class Kind:
    """What worlds have in common.

    Attributes:
        title: for readers.
        about: sentences for readers: what sets them apart.
        ranges: of their quantities.
        arenas: that they are in, as often each.
    """

    title: str
    about: str
    ranges: Mapping[str, tuple[float, float]]
    arenas: Sequence[str]


CALIBRATED_GAIN = 1.1
"""Largest factor by which the common gain is off after a calibration.

Its logarithm is the largest spread of the sensors' own gains. Source: gains that are
fitted to a log are right to 10 %, measured ones to 4 % (docs/calibration.md).
"""

CALIBRATED_RANGES: Mapping[str, tuple[float, float]] = {
    **WORLD_RANGES,
    "curve": (1 / CALIBRATED_GAIN, CALIBRATED_GAIN),
    "gain_spread": (0.0, float(np.log(CALIBRATED_GAIN))),
    "light": (1.0, 1.0),
}

KINDS: Mapping[str, Kind] = {
    "usual": Kind(
        "usual worlds",
        "Usual worlds share ranges with evolution: those of wheel radius, track, mass, "
        "friction and latency with randomise, and those of body, sensors' place, "
        "light, battery and slipping start with randomise_all as well. Policies that "
        "evolved on such robots have met such differences before.",
        WORLD_RANGES,
        ARENAS,
    ),
    "beyond": Kind(
        "ranges half as wide again",
        "In worlds with ranges half as wide again, every range that can be wider is "
        "wider by half.",
        half_as_wide_again(WORLD_RANGES),
        ARENAS,
    ),
    "corners": Kind(
        "outer corners and posts",
        "Worlds with outer corners and posts have the usual ranges, in the arenas "
        f"{', '.join(CORNERS)}.",
        WORLD_RANGES,
        CORNERS,
    ),
    "calibrated-gains": Kind(
        "gains calibrated to 10 %",
        "Worlds with calibrated gains have the usual ranges but for the sensors' "
        "gains: the gain that all share, light included, is right to 10 %, and each "
        "sensor's own gain differs from it with a standard deviation of at most 10 %.",
        CALIBRATED_RANGES,
        ARENAS,
    ),
}
"""Kinds of worlds by name.

New ones go to the end: a kind's place is the seed of its worlds.
"""


def worlds(n: int, kind: str = "usual") -> list[World]:
    """The first worlds of a Latin hypercube of `n`: every range in `n` even parts."""
    from scipy.stats import qmc

    own = KINDS[kind]
    # hypercubes of their own
    rng = np.random.default_rng([WORLD_SEED, list(KINDS).index(kind)])
    cube = qmc.LatinHypercube(len(own.ranges) + 1, rng=rng)
    found = []
    for number, (*shares, place) in enumerate(cube.random(n).tolist()):
        values = {
            name: _value(name, ends, share)
            for (name, ends), share in zip(own.ranges.items(), shares, strict=True)
        }
        arena = own.arenas[int(place * len(own.arenas))]
        found.append(World(kind=kind, number=number, arena=arena, **values))
    return found


def _value(name: str, ends: tuple[float, float], share: float) -> Any:
    """A whole number or another, as `World` has it."""
    low, high = ends
    if name in WHOLE:
        return int(low) + int(share * (high - low + 1))
    if name in LOGARITHMS:
        return float(low * (high / low) ** share)
    return float(low + share * (high - low))


def starts_in(world: World, space: FreeSpace, n: int) -> np.ndarray:
    """Starts `(n, 3)` in a world: others than in the next one."""
    return space.spread(_randomness(world, STARTS), n)


def met(world: World, n: int, steps: int) -> Disturbances:
    """Disturbances of `n` trials of `steps` steps in a world: one robot, new noise."""
    rng = _randomness(world, NOISE)
    # one robot in all trials: only its noise is new
    spread = np.exp(world.gain_spread * rng.standard_normal(N_PROXIMITY))
    gains = world.curve * world.light * spread
    age = rng.uniform(0, PROXIMITY_PERIOD, N_PROXIMITY)
    wheels = world.battery * world.wheel_radius / WHEEL_RADIUS
    sides = wheels * (1 + world.bias * np.array([0.5, -0.5]))

    def same(value: np.ndarray | float) -> np.ndarray:
        return np.repeat(np.array(value)[None], n, axis=0)

    count_noise = rng.standard_normal((n, steps + 1, N_PROXIMITY))
    wheel_noise = world.slip * rng.standard_normal((n, steps, N_WHEELS))
    latency = same(world.latency)
    return Disturbances(
        of=np.arange(n),
        gains=same(gains),
        known_gains=same(np.ones(N_PROXIMITY)),
        age=same(age),
        count_noise=world.count_noise * count_noise,
        wheel_gains=same(sides),
        turn_gain=same(TRACK / world.track),
        wheel_noise=with_slipping_start(
            wheel_noise, latency, same(world.slipping), same(world.grip)
        ),
        latency=latency,
        mass=same(world.mass),
        friction=same(world.friction),
        lag=np.ones(n),
        wider=same(world.body_radius - BODY_RADIUS),
        set_back=same(world.set_back),
    )


def _randomness(world: World, purpose: int) -> np.random.Generator:
    kind = list(KINDS).index(world.kind)
    return random_generator(WORLD_SEED, kind, world.number, purpose)
