"""Compiled policies: the network and the follower, with or without changes.

The same operations in the same order as the policies', so with the same bits.
"""

from typing import NamedTuple

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.follower import (
    AHEAD_LEFT,
    AHEAD_RIGHT,
    DIAGONAL,
    LEFT_DIAGONAL,
    SIDE,
    Rule,
)
from epuck_mj.policies.network import Controller
from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.rungs.kinematic.elementary import half_tanh


class Drivers(NamedTuple):
    """Policies of trials `(n,)` as the kernel wants them.

    Attributes:
        rule: whether they are followers, not networks.
        inputs: numbers they see: readings, and their changes if these are seen.
        hidden: weights of networks, as in `Controller`.
        output: likewise.
        numbers: of followers, as in `Rule`.
    """

    rule: bool
    inputs: int
    hidden: np.ndarray
    output: np.ndarray
    numbers: np.ndarray


def drivers_of(policy: Controller | WithChanges) -> Drivers:
    """A batch policy `(n,)` for the kernel.

    Raises:
        TypeError: if it is neither a network nor a follower.
    """
    changes = isinstance(policy, WithChanges)
    reflex = policy.reflex if changes else policy
    inputs = 2 * N_PROXIMITY if changes else N_PROXIMITY
    if isinstance(reflex, Rule):
        none = np.zeros((1, 1, 1))
        return Drivers(True, inputs, none, none, reflex.numbers)
    if isinstance(reflex, Controller):
        none = np.zeros((1, 1))
        return Drivers(False, inputs, reflex.hidden, reflex.output, none)
    raise TypeError(f"expected a network or a follower, got {reflex!r}")


@compiled(forceinline=True)
def notice(seen, last, k):
    """Put changes behind the readings, if there is room; see `WithChanges`."""
    n = last.shape[0]
    if seen.shape[0] > n:
        for i in range(n):
            seen[n + i] = seen[i] - last[i] if k > 0 else 0.0
            last[i] = seen[i]


@compiled(forceinline=True)
def decide(drivers, trial, seen, neurons, more_v, more_w):
    """Action v, w of a trial's policy; networks may explore."""
    if drivers.rule:
        return follow(drivers.numbers, trial, seen)
    return act(drivers.hidden, drivers.output, trial, seen, neurons, more_v, more_w)


@compiled(forceinline=True)
def act(hidden, output, trial, seen, neurons, more_v, more_w):
    """Action v, w of the network of a trial; see `exploring.Exploring`."""
    n_in, n_hidden = seen.shape[0], neurons.shape[0]
    for j in range(n_hidden):
        total = seen[0] * hidden[0, trial, j]
        for i in range(1, n_in):
            total += seen[i] * hidden[i, trial, j]
        if hidden.shape[0] > n_in:
            total += hidden[n_in, trial, j]
        neurons[j] = (half_tanh(total) + 1.0) * 0.5
    v = neurons[0] * output[0, trial, 0]
    w = neurons[0] * output[0, trial, 1]
    for j in range(1, n_hidden):
        v += neurons[j] * output[j, trial, 0]
        w += neurons[j] * output[j, trial, 1]
    if output.shape[0] > n_hidden:
        v += output[n_hidden, trial, 0]
        w += output[n_hidden, trial, 1]
    return (half_tanh(v + more_v) + 1.0) * 0.5, half_tanh(w + more_w)


@compiled(forceinline=True)
def follow(numbers, trial, seen):
    """Action v, w of the follower of a trial; see `follower.Rule`."""
    near, slow = numbers[0, trial], numbers[1, trial]
    creep, avoid, away = numbers[2, trial], numbers[3, trial], numbers[4, trial]
    left, diagonal = numbers[5, trial], numbers[6, trial]
    target, gain, damping = numbers[7, trial], numbers[8, trial], numbers[9, trial]
    most, lost, search = numbers[10, trial], numbers[11, trial], numbers[12, trial]
    ahead = min(seen[AHEAD_RIGHT], seen[AHEAD_LEFT])
    ahead = min(ahead, seen[LEFT_DIAGONAL] + left)
    forward = min(max((ahead - near) / slow, creep), 1.0)
    if ahead < avoid:
        return forward, -away
    side = diagonal * seen[DIAGONAL] + (1.0 - diagonal) * seen[SIDE]
    if not side < lost:
        return forward, search
    n = N_PROXIMITY
    grown = diagonal * seen[n + DIAGONAL] + (1.0 - diagonal) * seen[n + SIDE]
    turn = gain * (side - target) + damping * grown
    return forward, min(max(turn, -most), most)
