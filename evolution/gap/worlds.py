"""Worlds: pseudo-realities, spread evenly over differences of robots."""

from dataclasses import dataclass

import numpy as np

from epuck_mj.constants import (
    N_PROXIMITY,
    N_WHEELS,
    PROXIMITY_PERIOD,
    TRACK,
    WHEEL_RADIUS,
)
from epuck_mj.step import disturbances
from epuck_mj.step.disturbances import Disturbances
from evolution.settings.randomness import random_generator

WORLD_SEED = 0
"""Seed of the worlds, which are the same for all champions and studies."""


@dataclass(frozen=True)
class World:
    """A pseudo-reality.

    Attributes:
        arena: shipped arena.
        period: duration of a control step [s]; the nearest that physics steps allow.
        curve: counts of all proximity sensors against the published ones.
        gain_spread: standard deviation of the logarithm of each sensor's gain.
        count_noise: in published standard deviations.
        wheel_radius: of both wheels [m].
        bias: of the left wheel's speed over the right one's.
        track: effective distance of the wheels [m].
        slip: relative standard deviation of a wheel's speed in a control step.
        latency: control steps until a command has reached the wheels.
        mass: of the robot against its own.
        friction: of its wheels against their own.
    """

    arena: str
    period: float
    curve: float
    gain_spread: float
    count_noise: float
    wheel_radius: float
    bias: float
    track: float
    slip: float
    latency: int
    mass: float
    friction: float


ARENAS = ("arena", "small_square", "rectangle", "l_shape", "octagon")

WORLD_RANGES: dict[str, tuple[float, float]] = {
    "period": (0.08, 0.12),
    # a logarithm: half as strong is as likely as twice as strong
    "curve": (np.log(1 / 1.5), np.log(1.5)),
    "gain_spread": (0.0, 0.25),
    "count_noise": (0.0, 3.0),
    "wheel_radius": disturbances.RANGES.wheel_radius,
    "bias": (-0.03, 0.03),
    "track": disturbances.RANGES.track,
    "slip": (0.0, 0.06),
    "mass": disturbances.RANGES.mass,
    "friction": disturbances.RANGES.friction,
}
"""Lowest and highest values of the continuous quantities.

Source: the figures of books and drivers differ by so much (those of randomised robots
in evolution), and so do the gains of eight sensors of two robots.
"""

LATENCY_MAX = disturbances.RANGES.latency[1]


def worlds(n: int) -> list[World]:
    """The first worlds of a Latin hypercube of `n`: every range in `n` even parts."""
    from scipy.stats import qmc

    names, ranges = list(WORLD_RANGES), list(WORLD_RANGES.values())
    cube = qmc.LatinHypercube(len(names) + 2, rng=np.random.default_rng(WORLD_SEED))
    found = []
    for row in cube.random(n):
        values = {
            name: low + share * (high - low)
            for name, (low, high), share in zip(names, ranges, row, strict=False)
        }
        values["curve"] = float(np.exp(values["curve"]))
        arena, latency = row[-2] * len(ARENAS), row[-1] * (LATENCY_MAX + 1)
        plain = {name: float(value) for name, value in values.items()}
        found.append(World(arena=ARENAS[int(arena)], latency=int(latency), **plain))
    return found


def met(world: World, index: int, n: int, steps: int) -> Disturbances:
    """Disturbances of `n` trials of `steps` steps in a world: one robot, new noise.

    Args:
        world: the pseudo-reality.
        index: its number, by which its noise is drawn.
        n: number of trials.
        steps: control steps of a trial.
    """
    rng = random_generator(WORLD_SEED, index)
    # one robot in all trials, with new noise in each
    gains = world.curve * np.exp(world.gain_spread * rng.standard_normal(N_PROXIMITY))
    age = rng.uniform(0, PROXIMITY_PERIOD, N_PROXIMITY)
    wheels = world.wheel_radius / WHEEL_RADIUS
    sides = wheels * (1 + world.bias * np.array([0.5, -0.5]))

    def same(value: np.ndarray | float) -> np.ndarray:
        return np.repeat(np.array(value)[None], n, axis=0)

    count_noise = rng.standard_normal((n, steps + 1, N_PROXIMITY))
    return Disturbances(
        of=np.arange(n),
        gains=same(gains),
        known_gains=same(np.ones(N_PROXIMITY)),
        age=same(age),
        count_noise=world.count_noise * count_noise,
        wheel_gains=same(sides),
        turn_gain=same(TRACK / world.track),
        wheel_noise=world.slip * rng.standard_normal((n, steps, N_WHEELS)),
        latency=same(world.latency),
        mass=same(world.mass),
        friction=same(world.friction),
        lag=np.ones(n),
    )
