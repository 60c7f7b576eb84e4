"""Whole trials of shipped policies on kinematic robots, in compiled code.

The same operations in the same order as `control.run_trials` with `KinematicRobots`,
so with the same bits, one trial after the other.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from epuck_mj.constants import (
    MOTOR_TICK_RATE,
    N_PROXIMITY,
    PROXIMITY_COUNT_MAX,
    STEP_RATE_MAX,
    TRACK,
    WHEEL_RADIUS,
    WHEEL_SPEED_MAX,
)
from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.network import Controller
from epuck_mj.rungs.bodies import SPARE_SPEED
from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.rungs.kinematic.drivers import Drivers, decide, drivers_of, notice
from epuck_mj.rungs.kinematic.kernel import (
    COS,
    SIN,
    X,
    Y,
    exp,
    move,
    rays_of,
    sense,
)
from epuck_mj.rungs.kinematic.plan import Plan, plan_of
from epuck_mj.rungs.kinematic.robots import (
    at_rest,
    own_numbers,
    room_for,
    substeps,
)
from epuck_mj.scene.model import Scene
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.control import TaskParameters, Trials
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.step.fitness import SPACED_FAR, SPACED_NEAR
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import (
    LOG_COUNTS,
    NOISE,
    NOISE_DISTANCES,
    PROXIMITY_DISTANCES,
    PROXIMITY_REACH,
    sensed_distance,
)

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


@compiled(forceinline=True)
def interpolate(x, xs, ys):
    """See `elementary.interpolate`."""
    n = xs.shape[0]
    x = min(max(x, xs[0]), xs[n - 1])
    i = 0
    while i < n - 2 and xs[i + 1] <= x:
        i += 1
    slope = (ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i])
    return ys[i] + (x - xs[i]) * slope


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
        deviation = interpolate(far, NOISE_DISTANCES, NOISE)
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
    """
    truth, before = np.empty(N_PROXIMITY), np.empty(N_PROXIMITY)
    distance, last = np.empty(N_PROXIMITY), np.empty(N_PROXIMITY)
    # of some policies, the changes of the readings come behind them
    observation = np.empty(drivers.inputs)
    neurons = np.empty(drivers.hidden.shape[2])
    delay = noise.latency[which] if noise.there else task.late
    sent = np.zeros((delay + 1, 2))
    body, (rays, edge) = plan.body, rays_of(plan, own, i)
    limit = body.speed_max * (SPARE_SPEED if noise.there else 1.0)
    grid, first, near, sides, ellipses = plan.solid
    seen_grid, seen_first, seen_near, seen_sides, seen_ellipses = plan.seen
    gains, share, count_noise = noise.gains, noise.share, noise.count_noise
    table = noise.tables[noise.table[which]]
    wheel_gains, wheel_noise = noise.wheel_gains, noise.wheel_noise
    turn_gain = noise.turn_gain[which]
    sense(
        rays,
        edge,
        task.reach,
        seen_grid,
        seen_first,
        seen_near,
        seen_sides,
        seen_ellipses,
        states[i, X],
        states[i, Y],
        states[i, COS],
        states[i, SIN],
        truth,
    )
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
        crashed = move(
            body,
            grid,
            first,
            near,
            sides,
            ellipses,
            states,
            i,
            own,
            left,
            right,
            task.n_substeps,
            task.substep,
        )
        if crashed:
            return fitness, k + 1, True
        sense(
            rays,
            edge,
            task.reach,
            seen_grid,
            seen_first,
            seen_near,
            seen_sides,
            seen_ellipses,
            states[i, X],
            states[i, Y],
            states[i, COS],
            states[i, SIN],
            truth,
        )
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
            )
            total += fitness[i]
            if total + rest < to_beat[individual]:
                break


class FusedTrials:
    """Compiled trials in one scene; see `CompiledTrials`."""

    def __init__(
        self, scene: Scene, task: TaskParameters, threads: int = 0, late: int = 0
    ):
        """Store what a trial is.

        Args:
            scene: robot and arena.
            task: length, fitness, sensors and speeds of a trial.
            threads: that run trials; 0 is one per core.
            late: control steps until a command has reached the wheels of ideal robots.
        """
        self._scene, self._task, self._late = scene, task, late
        self._threads = threads or os.cpu_count() or 1
        self._plans: dict[tuple[float, float], Plan] = {}

    def __call__(
        self,
        controller: Controller | WithChanges,
        starts: np.ndarray,
        disturbances: Disturbances | None,
        per_individual: int,
        to_beat: np.ndarray,
    ) -> Trials:
        """See `CompiledTrials`.

        Raises:
            UserError: if the scene has no plan.
        """
        work = controller, starts, disturbances, per_individual, to_beat
        return self._run(*work, NOTHING_TRIED)

    def explored(
        self,
        controller: Controller | WithChanges,
        starts: np.ndarray,
        disturbances: Disturbances | None,
        tried: np.ndarray,
    ) -> tuple[Trials, np.ndarray, np.ndarray]:
        """See `CompiledTrials`.

        Raises:
            UserError: if the scene has no plan.
        """
        n, steps = len(starts), self._task.steps
        shape = n, steps, N_PROXIMITY
        made = Exploration(True, tried, np.zeros(shape), np.zeros((n, steps)))
        never = np.full(n, -np.inf)
        trials = self._run(controller, starts, disturbances, 1, never, made)
        return trials, made.observation, made.reward

    def _run(
        self,
        controller: Controller | WithChanges,
        starts: np.ndarray,
        disturbances: Disturbances | None,
        per_individual: int,
        to_beat: np.ndarray,
        exploration: Exploration,
    ) -> Trials:
        drivers = drivers_of(controller)
        n, time = len(starts), self._task.control_step
        noise, of = _noise(disturbances, n, time)
        reach = self._task.sensor_range
        bodies = Bodies.own(n)
        if disturbances is not None:
            reach, bodies = max(reach, PROXIMITY_REACH), disturbances.bodies
        plan = self._plan(reach, room_for(bodies))
        task = self._compiled_task(reach)
        states, own = at_rest(starts), own_numbers(plan, bodies, time)
        fitness, steps = np.zeros(n), np.zeros(n, np.int64)
        crashed = np.zeros(n, bool)

        def run(part: tuple[int, int]) -> None:
            trials(
                plan,
                task,
                noise,
                exploration,
                of,
                drivers,
                states,
                own,
                *part,
                per_individual,
                to_beat,
                fitness,
                steps,
                crashed,
            )

        parts = _parts(n // per_individual, self._threads)
        if len(parts) == 1:
            run(parts[0])
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                list(pool.map(run, parts))
        return Trials(fitness, steps, crashed)

    def _plan(self, reach: float, wider: float) -> Plan:
        if (reach, wider) not in self._plans:
            step = self._task.control_step
            self._plans[reach, wider] = plan_of(self._scene, reach, step, wider)
        return self._plans[reach, wider]

    def _compiled_task(self, reach: float) -> Task:
        speeds = self._task.speeds
        return Task(
            self._task.steps,
            FITNESS.index(self._task.fitness),
            1.0,
            self._task.sensor_range,
            reach,
            speeds.forward / WHEEL_RADIUS,
            speeds.turn * TRACK / (2 * WHEEL_RADIUS),
            WHEEL_SPEED_MAX,
            *substeps(self._task.control_step),
            self._late,
        )


def _parts(individuals: int, threads: int) -> list[tuple[int, int]]:
    """First and last individual of each part, several for each thread."""
    n = 1 if threads == 1 else max(1, min(individuals, 4 * threads))
    bounds = np.linspace(0, individuals, n + 1).astype(int).tolist()
    return list(pairwise(bounds))


def _noise(
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
