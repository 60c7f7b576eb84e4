"""Tracks: where many robots went in one trial each, as plain arrays.

What metrics need of a trial and no more; `trajectory` records all of a single one.
"""

from dataclasses import dataclass

import numpy as np

from epuck_mj.control import BatchPolicy, TaskParameters, control_step
from epuck_mj.disturbances import Disturbances
from epuck_mj.disturbed_robots import DisturbedRobots, disturbed
from epuck_mj.sensors import observe
from epuck_mj.simulation import SimulatedRobots


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
    group = np.arange(n) // robots.capacity
    for members in (group == i for i in range(group.max(initial=-1) + 1)):
        met = None if disturbances is None else disturbances[members]
        mine = disturbed(robots, met, task.control_step)
        _record(mine, policy[members], starts, task, tracks, np.flatnonzero(members))
    return tracks


def _record(
    robots: SimulatedRobots | DisturbedRobots,
    policy: BatchPolicy,
    starts: np.ndarray,
    task: TaskParameters,
    tracks: Tracks,
    active: np.ndarray,
) -> None:
    """Fill in the trials of indices `active`, one robot and one policy member each."""
    observation = observe(robots.reset(starts[active]).distance, task.sensor_range)
    tracks.pose[active, 0] = robots.poses()
    for k in range(task.steps):
        step = control_step(robots, policy, observation, task)
        observation = step.observation
        tracks.pose[active, k + 1] = robots.poses()
        tracks.command[active, k] = step.command
        tracks.fitness[active, k] = step.fitness
        tracks.steps[active] += 1
        alive = ~step.reading.contact
        tracks.crashed[active] = ~alive
        # those who are done leave; everything kept per robot follows
        if not alive.all():
            active, observation = active[alive], observation[alive]
            if not active.size:
                break
            policy = policy[alive]
            robots.keep(alive)
