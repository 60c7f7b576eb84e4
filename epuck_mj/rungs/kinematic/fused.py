"""Whole trials of shipped policies on kinematic robots, in compiled code.

The same bits as `control.run_trials` with `KinematicRobots`, one trial after the other.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from epuck_mj.constants import N_PROXIMITY, TRACK, WHEEL_RADIUS, WHEEL_SPEED_MAX
from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.network import Controller
from epuck_mj.rungs.kinematic.drivers import drivers_of
from epuck_mj.rungs.kinematic.noise import noise_of
from epuck_mj.rungs.kinematic.plan import Plan, plan_of
from epuck_mj.rungs.kinematic.robots import (
    at_rest,
    own_numbers,
    room_for,
    substeps,
)
from epuck_mj.rungs.kinematic.whole_trial import (
    FITNESS,
    NOTHING_TRIED,
    Exploration,
    Task,
    room_for_a_trial,
    trials,
)
from epuck_mj.scene.model import Scene
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.control import TaskParameters, Trials
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.step.sensors import PROXIMITY_REACH


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
        noise, of = noise_of(disturbances, n, time)
        reach = self._task.sensor_range
        bodies = Bodies.own(n)
        if disturbances is not None:
            reach, bodies = max(reach, PROXIMITY_REACH), disturbances.bodies
        if self._scene.cosines.size:
            # a cone counts all that its rays meet
            reach = max(reach, PROXIMITY_REACH)
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
                room_for_a_trial(plan, task, noise, drivers),
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
