"""Genomes to fitness: every individual of a generation lives the same trials.

Two engines with the same bits: `batch` steps all robots at once on
`mujoco.batch.Batch`; `dm_control` steps the dm_control task, one trial after another.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from epuck_mj.control import TaskParameters, Trials, run_trials
from epuck_mj.controller import Controller, Network
from epuck_mj.model import Scene
from epuck_mj.simulation import SimulatedRobots
from epuck_mj.tasks import FollowWalls, environment

CAPACITY = 1024
"""Robots simulated at once: bounds memory, changes no result."""


@dataclass(frozen=True)
class Evaluation:
    """Trials of `(individuals,)` genomes on `(trials,)` starts.

    Attributes:
        trial_fitness: sum of the step fitness, `(individuals, trials)`.
        steps: control steps lived, `(individuals, trials)`.
        crashed: whether a crash ended the trial, `(individuals, trials)`.
    """

    trial_fitness: np.ndarray
    steps: np.ndarray
    crashed: np.ndarray

    @property
    def fitness(self) -> np.ndarray:
        """Mean over the trials, `(individuals,)`. Source: paper, section 4."""
        return self.trial_fitness.mean(axis=-1)


class Engine(Protocol):
    """Runs one trial per member of a batch of controllers."""

    def run(self, controller: Controller, starts: np.ndarray) -> Trials:
        """Outcome of `(n,)` trials of `(n,)` controllers on `(n, 3)` starts."""
        ...


class BatchEngine:
    """All trials at once, on threads."""

    def __init__(self, scene: Scene, task: TaskParameters, threads: int = 0):
        """Allocate the robots; `threads` 0 is one per core."""
        self._task = task
        self._robots = SimulatedRobots(scene, CAPACITY, threads)

    def run(self, controller: Controller, starts: np.ndarray) -> Trials:
        """See `Engine.run`."""
        parts = [
            run_trials(self._robots, controller[chunk], starts[chunk], self._task)
            for chunk in _chunks(len(starts))
        ]
        return _joined(parts)


class DmControlEngine:
    """One trial after the other, on the dm_control task itself."""

    def __init__(self, scene: Scene, task: TaskParameters):
        """Remember the scene; an environment lives as long as a call of `run`."""
        self._scene = scene
        self._task = task

    def run(self, controller: Controller, starts: np.ndarray) -> Trials:
        """See `Engine.run`."""
        task = FollowWalls(self._scene, self._task, starts=starts)
        env = environment(self._scene, task)
        fitness = np.zeros(len(starts))
        steps = np.zeros(len(starts), int)
        crashed = np.zeros(len(starts), bool)
        for i in range(len(starts)):
            policy, time_step = controller[i], env.reset()
            while not time_step.last():
                time_step = env.step(policy(time_step.observation["proximity"]))
                fitness[i] += time_step.reward
                steps[i] += 1
            crashed[i] = task.crashed(env.physics)
        return Trials(fitness, steps, crashed)


def evaluate(
    engine: Engine, network: Network, genomes: np.ndarray, starts: np.ndarray
) -> Evaluation:
    """All individuals on all starts.

    Args:
        engine: what runs the trials.
        network: shape of the genomes.
        genomes: `(individuals, genes)`.
        starts: poses `(trials, 3)`, x, y [m], yaw [rad]: the same for everybody.
    """
    shape = (len(genomes), len(starts))
    controller = network.decode(np.repeat(genomes, len(starts), axis=0))
    trials = engine.run(controller, np.tile(starts, (len(genomes), 1)))
    return Evaluation(
        trials.fitness.reshape(shape),
        trials.steps.reshape(shape),
        trials.crashed.reshape(shape),
    )


def _chunks(n: int) -> Iterator[slice]:
    for first in range(0, n, CAPACITY):
        yield slice(first, min(first + CAPACITY, n))


def _joined(parts: list[Trials]) -> Trials:
    return Trials(
        np.concatenate([part.fitness for part in parts]),
        np.concatenate([part.steps for part in parts]),
        np.concatenate([part.crashed for part in parts]),
    )
