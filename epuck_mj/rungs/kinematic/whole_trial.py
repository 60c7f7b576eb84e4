"""A whole trial in one compiled function: policy, motors, motion, sensors, fitness.

The same operations in the same order as `control.run_trials` with `KinematicRobots`.
"""

from typing import NamedTuple

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.rungs.kinematic.drivers import Drivers, decide, notice
from epuck_mj.rungs.kinematic.kernel import (
    Rays,
    move,
    place_rays,
    room_for_rays,
    sense,
)
from epuck_mj.rungs.kinematic.noise import Noise, motor, sensed
from epuck_mj.rungs.kinematic.plan import Plan
from epuck_mj.step.bodies import SPARE_SPEED
from epuck_mj.step.fitness import SPACED_FAR, SPACED_NEAR
from epuck_mj.step.sensors import PROXIMITY_REACH

FITNESS = ("product", "literal", "spaced")
"""Step fitness forms that are compiled, by their numbers."""


class Task(NamedTuple):
    """What a trial is.

    Attributes:
        steps: control steps.
        fitness: number of the form in `FITNESS`.
        most: the most that a control step is worth.
        sensor_range: where an obstacle stops being seen [m].
        reach: farthest that rays have to see [m].
        forward: wheel speed of v = 1 [rad/s].
        turn: difference of either wheel's speed at w = 1 [rad/s].
        speed_max: of a wheel that is told its speed [rad/s].
        n_substeps: substeps of a control step.
        substep: duration of one [s].
        late: control steps until a command has reached the wheels of an ideal robot.
    """

    steps: int
    fitness: int
    most: float
    sensor_range: float
    reach: float
    forward: float
    turn: float
    speed_max: float
    n_substeps: int
    substep: float
    late: int


class Exploration(NamedTuple):
    """What trials of learners try, and what of them is written down.

    Attributes:
        there: whether they explore.
        tried: added to the weighted sums of v and w, `(n, steps, 2)`.
        observation: at the beginning of each step, `(n, steps, 8)`; filled.
        reward: step fitness, `(n, steps)`; filled.
    """

    there: bool
    tried: np.ndarray
    observation: np.ndarray
    reward: np.ndarray


NOTHING_TRIED = Exploration(
    False, np.zeros((1, 1, 2)), np.zeros((1, 1, N_PROXIMITY)), np.zeros((1, 1))
)


class Room(NamedTuple):
    """Room for what a trial needs while it lasts; one trial after the other uses it.

    Attributes:
        rays: of the robot.
        truth: distance that each sensor sees [m], `(8,)`.
        before: the same one control step earlier, `(8,)`.
        distance: what disturbed sensors say, `(8,)`.
        last: observation of the last control step, `(8,)`.
        observation: inputs of the policy; changes of readings come last.
        neurons: outputs of the hidden neurons.
        sent: commands that have not reached the wheels, `(control steps, 2)`.
    """

    rays: Rays
    truth: np.ndarray
    before: np.ndarray
    distance: np.ndarray
    last: np.ndarray
    observation: np.ndarray
    neurons: np.ndarray
    sent: np.ndarray


def room_for_a_trial(plan: Plan, task: Task, noise: Noise, drivers: Drivers) -> Room:
    """Room for any of these trials."""
    delay = int(noise.latency.max()) if noise.there else task.late
    truth, before, distance, last = np.empty((4, N_PROXIMITY))
    return Room(
        room_for_rays(plan),
        truth,
        before,
        distance,
        last,
        np.empty(drivers.inputs),
        np.empty(drivers.hidden.shape[2]),
        np.empty((delay + 1, 2)),
    )


@compiled(forceinline=True)
def observe(distance, sensor_range, observation):
    """See `sensors.observe`; fills `(8,)`, the least of them."""
    least = 1.0
    for i in range(distance.shape[0]):
        seen = sensor_range if distance[i] < 0.0 else distance[i]
        observation[i] = min(seen / sensor_range, 1.0)
        least = min(least, observation[i])
    return least


@compiled()
def trial(
    plan: Plan,
    task: Task,
    noise: Noise,
    exploration: Exploration,
    which,
    drivers: Drivers,
    i,
    states,
    own,
    needed,
    room: Room,
):
    """One trial: fitness, control steps, whether it crashed.

    Args:
        plan: robot and arena.
        task: what a trial is.
        noise: disturbances.
        exploration: of learners.
        which: of the disturbances the trial meets.
        drivers: policies of all trials.
        i: number of the trial among these.
        states: of all robots on their starts, `(n, N_STATE)`; changed.
        own: numbers of their bodies, `(n, N_OWN)`.
        needed: fitness that it has to reach to matter; the trial ends when it cannot.
        room: for what it needs while it lasts.
    """
    rays, truth, before, distance, last, observation, neurons, sent = room
    delay = noise.latency[which] if noise.there else task.late
    for k in range(delay + 1):
        sent[k, 0] = sent[k, 1] = 0.0
    edge = place_rays(plan, own, i, rays)
    limit = plan.body.speed_max * (SPARE_SPEED if noise.there else 1.0)
    gains, share, count_noise = noise.gains, noise.share, noise.count_noise
    table = noise.tables[noise.table[which]]
    wheel_gains, wheel_noise = noise.wheel_gains, noise.wheel_noise
    turn_gain = noise.turn_gain[which]
    sense(plan, rays, edge, task.reach, states, i, truth)
    if noise.there:
        for j in range(N_PROXIMITY):
            before[j] = -1.0 if truth[j] > PROXIMITY_REACH else truth[j]
        sensed(gains, table, share, count_noise, which, 0, truth, before, distance)
        observe(distance, task.sensor_range, observation)
    else:
        observe(truth, task.sensor_range, observation)
    fitness, more_v, more_w = 0.0, 0.0, 0.0
    for k in range(task.steps):
        if exploration.there:
            more_v, more_w = exploration.tried[i, k, 0], exploration.tried[i, k, 1]
            for j in range(N_PROXIMITY):
                exploration.observation[i, k, j] = observation[j]
        notice(observation, last, k)
        v, w = decide(drivers, i, observation, neurons, more_v, more_w)
        forward, turn = v * task.forward, w * task.turn
        left = min(max(forward + turn, -task.speed_max), task.speed_max)
        right = min(max(forward - turn, -task.speed_max), task.speed_max)
        if noise.there:
            place = k % (delay + 1)
            sent[place, 0], sent[place, 1] = left, right
            # what was sent `delay` steps ago is what the next one replaces
            place = (k + 1) % (delay + 1)
            left = motor(sent[place, 0]) * (
                wheel_gains[which, 0] * (1.0 + wheel_noise[which, k, 0])
            )
            right = motor(sent[place, 1]) * (
                wheel_gains[which, 1] * (1.0 + wheel_noise[which, k, 1])
            )
            mean = (left + right) / 2.0
            left = mean + (left - mean) * turn_gain
            right = mean + (right - mean) * turn_gain
        elif delay > 0:
            place = k % (delay + 1)
            sent[place, 0], sent[place, 1] = left, right
            place = (k + 1) % (delay + 1)
            left, right = sent[place, 0], sent[place, 1]
        left, right = min(max(left, -limit), limit), min(max(right, -limit), limit)
        n, time = task.n_substeps, task.substep
        if move(plan.body, plan.solid, states, i, own, left, right, n, time):
            return fitness, k + 1, True
        sense(plan, rays, edge, task.reach, states, i, truth)
        nearest = observe(truth, task.sensor_range, observation)
        close = 1.0 - nearest
        if noise.there:
            sensed(
                gains, table, share, count_noise, which, k + 1, truth, before, distance
            )
            observe(distance, task.sensor_range, observation)
        turning = abs(w)
        if task.fitness == 0:
            reward = v * (1.0 - turning) * close
        elif task.fitness == 1:
            reward = v * (1.0 - turning * close)
        else:
            kept = min(nearest / SPACED_NEAR, close / (1.0 - SPACED_FAR), 1.0)
            reward = v * (1.0 - turning) * kept
        fitness += reward
        if exploration.there:
            exploration.reward[i, k] = reward
        if fitness + (task.steps - 1 - k) * task.most < needed:
            return fitness, k + 1, False
    return fitness, task.steps, False


@compiled()
def trials(
    plan: Plan,
    task: Task,
    noise: Noise,
    exploration: Exploration,
    of,
    drivers: Drivers,
    states,
    own,
    first,
    last,
    per_individual,
    to_beat,
    fitness,
    steps,
    crashed,
    room: Room,
):
    """Trials of the individuals from `first` to `last`; fills what came of them.

    Args:
        plan: robot and arena.
        task: what a trial is.
        noise: disturbances.
        exploration: of learners.
        of: which of the disturbances each trial meets, `(n,)`.
        drivers: policies of all trials.
        states: of the robots on their starts, `(n, N_STATE)`; changed.
        own: numbers of their bodies, `(n, N_OWN)`.
        first: individual.
        last: individual, which is not among them.
        per_individual: trials of each.
        to_beat: sum of fitness below which an individual has lost, `(individuals,)`.
        fitness: of each trial, `(n,)`.
        steps: control steps of each trial, `(n,)`.
        crashed: whether it crashed, `(n,)`.
        room: for what a trial needs while it lasts.
    """
    for individual in range(first, last):
        total = 0.0
        for t in range(per_individual):
            i = individual * per_individual + t
            # what the trials to come can earn at most
            rest = (per_individual - 1 - t) * task.steps * task.most
            needed = to_beat[individual] - total - rest
            fitness[i], steps[i], crashed[i] = trial(
                plan,
                task,
                noise,
                exploration,
                of[i],
                drivers,
                i,
                states,
                own,
                needed,
                room,
            )
            total += fitness[i]
            if total + rest < to_beat[individual]:
                break
