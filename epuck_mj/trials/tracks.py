"""Tracks: where many robots went in one trial each, as plain arrays.

What metrics need of a trial and no more; `trajectory` records all of a single one.
"""

from dataclasses import dataclass

import numpy as np

from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.mujoco_batch import SimulatedRobots
from epuck_mj.step.control import (
    BatchPolicy,
    ControlStep,
    Seen,
    TaskParameters,
    run_trials,
)
from epuck_mj.step.disturbances import Disturbances


@dataclass(frozen=True, eq=False)
class Tracks:
    """Trials of `(n,)` robots of at most `T` control steps; NaN after their end.

    `command[:, k]` earned `fitness[:, k]` and led to `pose[:, k + 1]`; `pose[:, 0]` is
    the start.

    Attributes:
        pose: where the robots were, `(n, T + 1, 3)`: x, y [m], yaw [rad].
        command: wheel speeds sent, left and right [rad/s], `(n, T, 2)`.
        fitness: step fitness, `(n, T)`.
        steps: control steps lived, the crash step included, `(n,)`.
        crashed: whether a crash ended the trial, `(n,)`.
    """

    pose: np.ndarray
    command: np.ndarray
    fitness: np.ndarray
    steps: np.ndarray
    crashed: np.ndarray

    def __post_init__(self) -> None:
        """Refuse arrays that do not belong together."""
        n, steps = self.fitness.shape
        expected = {
            "pose": (n, steps + 1, 3),
            "command": (n, steps, 2),
            "steps": (n,),
            "crashed": (n,),
        }
        for name, shape in expected.items():
            if (got := getattr(self, name).shape) != shape:
                raise ValueError(f"expected {name} of shape {shape}, got {got}")

    @property
    def lived(self) -> np.ndarray:
        """Which steps the robots lived, `(n, T)`."""
        return np.arange(self.fitness.shape[1]) < self.steps[:, None]

    @property
    def trial_fitness(self) -> np.ndarray:
        """Sum of the step fitness, `(n,)`: to the last bit that of `run_trials`."""
        # in the order of the steps: numpy's sum has an order of its own
        earned = np.where(self.lived, self.fitness, 0.0)
        return np.cumsum(earned, axis=1)[:, -1]


def record_tracks(
    robots: SimulatedRobots,
    policy: BatchPolicy,
    starts: np.ndarray,
    task: TaskParameters,
    disturbances: Disturbances | None = None,
) -> Tracks:
    """One trial per start; a robot that crashes is not stepped again.

    Args:
        robots: to put on the starts, as many at a time as there are.
        policy: one member per start.
        starts: poses `(n, 3)`: x, y [m], yaw [rad].
        task: what a trial is.
        disturbances: of each trial; None for ideal robots.
    """
    n = len(starts)
    tracks = Tracks(
        pose=np.full((n, task.steps + 1, 3), np.nan),
        command=np.full((n, task.steps, 2), np.nan),
        fitness=np.full((n, task.steps), np.nan),
        steps=np.zeros(n, int),
        crashed=np.zeros(n, bool),
    )
    tracks.pose[:, 0] = robots.scene.poses(robots.scene.qpos(starts))
    for first in range(0, n, robots.capacity):
        members = slice(first, first + robots.capacity)
        met = None if disturbances is None else disturbances[members]
        trials = run_trials(
            disturbed(robots, met, task.control_step),
            policy[members],
            starts[members],
            task,
            seen=_recorder(robots, tracks, members),
        )
        tracks.steps[members], tracks.crashed[members] = trials.steps, trials.crashed
    return tracks


def _recorder(robots: SimulatedRobots, tracks: Tracks, members: slice) -> Seen:
    """Writes every step of those members into their tracks."""
    pose, command = tracks.pose[members], tracks.command[members]
    fitness = tracks.fitness[members]

    def seen(k: int, active: np.ndarray, step: ControlStep) -> None:
        pose[active, k + 1] = robots.poses()
        command[active, k] = step.command
        fitness[active, k] = step.fitness

    return seen
