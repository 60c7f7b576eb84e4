"""Compiled sensors and motors of disturbed robots.

The same operations in the same order as those of `rungs.disturbed.DisturbedRobots`.
"""

from typing import NamedTuple

import numpy as np

from epuck_mj.constants import (
    MOTOR_TICK_RATE,
    N_PROXIMITY,
    PROXIMITY_COUNT_MAX,
    STEP_RATE_MAX,
)
from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.rungs.kinematic.elementary import exp, interpolate
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import (
    COUNT_NOISE,
    LOG_COUNTS,
    NOISE_DISTANCES,
    PROXIMITY_DISTANCES,
    PROXIMITY_REACH,
    sensed_distance,
)


class Noise(NamedTuple):
    """`Disturbances` as the kernel wants them, one of `(k,)`.

    Attributes:
        there: whether there are any.
        tables: distance of each count [m], `(tables, 8, counts)`.
        table: which of them, `(k,)`.
    """

    there: bool
    gains: np.ndarray
    tables: np.ndarray
    table: np.ndarray
    share: np.ndarray
    count_noise: np.ndarray
    wheel_gains: np.ndarray
    turn_gain: np.ndarray
    wheel_noise: np.ndarray
    latency: np.ndarray


def noise_of(
    given: Disturbances | None, n: int, control_step: float
) -> tuple[Noise, np.ndarray]:
    """Disturbances for the kernel, and which of them each of `n` trials meets."""
    if given is None:
        none = np.zeros((1, N_PROXIMITY))
        nothing = Noise(
            False,
            none,
            none[None],
            np.zeros(1, np.int64),
            none,
            none[None],
            none,
            none[0],
            none[None],
            np.zeros(1, np.int64),
        )
        return nothing, np.zeros(n, np.int64)
    known, table = np.unique(given.known_gains, axis=0, return_inverse=True)
    counts = np.arange(PROXIMITY_COUNT_MAX + 1.0)
    tables = sensed_distance(counts[:, None], known[:, None, :])
    noise = Noise(
        True,
        given.gains,
        np.ascontiguousarray(np.moveaxis(tables, 1, 2)),
        table.reshape(-1).astype(np.int64),
        given.age / control_step,
        given.count_noise,
        given.wheel_gains,
        given.turn_gain,
        given.wheel_noise,
        given.latency.astype(np.int64),
    )
    return noise, given.of.astype(np.int64)


@compiled(forceinline=True)
def sensed(gains, table, share, count_noise, which, k, truth, before, distance):
    """What a disturbed robot senses, `(8,)`; see `DisturbedRobots`."""
    for i in range(truth.shape[0]):
        now = -1.0 if truth[i] > PROXIMITY_REACH else truth[i]
        aged = now + (before[i] - now) * share[which, i]
        if now < 0.0 or before[i] < 0.0:
            aged = now
        counts, last = 0.0, PROXIMITY_DISTANCES.shape[0] - 1
        if 0.0 <= aged <= PROXIMITY_DISTANCES[last]:
            log = interpolate(aged, PROXIMITY_DISTANCES, LOG_COUNTS)
            counts = min(exp(log) * gains[which, i], PROXIMITY_COUNT_MAX)
        far = NOISE_DISTANCES[NOISE_DISTANCES.shape[0] - 1] if aged < 0.0 else aged
        deviation = interpolate(far, NOISE_DISTANCES, COUNT_NOISE)
        counts = np.rint(counts + count_noise[which, k, i] * deviation)
        counts = min(max(counts, 0.0), PROXIMITY_COUNT_MAX)
        distance[i] = table[i, np.int64(counts)]
        before[i] = now


@compiled(forceinline=True)
def motor(wheel):
    """Speed of a wheel [rad/s] whose motor makes whole steps in whole ticks."""
    rate = np.rint(wheel / STEP_ANGLE)
    rate = min(max(rate, -float(STEP_RATE_MAX)), float(STEP_RATE_MAX))
    if rate == 0.0:
        return 0.0
    ticks = np.floor(MOTOR_TICK_RATE / abs(rate))
    speed = MOTOR_TICK_RATE / ticks
    return (speed if rate > 0.0 else -speed) * STEP_ANGLE
