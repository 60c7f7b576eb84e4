"""The recorder: trials written into arrays while they are simulated.

Tracks and trajectories come from `run_trials`, the loop of evolution. So on every rung,
with or without disturbances, they are bit-identical to what was evaluated.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.host.memory import TRACK_BYTES, TRAJECTORY_BYTES, check_memory
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.simulator import Simulator
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene
from epuck_mj.step.control import (
    BatchPolicy,
    ControlStep,
    Everybody,
    Policy,
    Robots,
    TaskParameters,
    Trials,
    run_trials,
)
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.step.sensors import Reading, proximity
from epuck_mj.trials.tracks import Tracks
from epuck_mj.trials.trajectory import Trajectory, hidden_outputs


def record_tracks(
    robots: Simulator,
    policy: BatchPolicy,
    starts: np.ndarray,
    task: TaskParameters,
    disturbances: Disturbances | None = None,
) -> Tracks:
    """Tracks of one trial per start; a robot that crashes is not stepped again.

    Args:
        robots: to put on the starts, as many at a time as there are.
        policy: one member per start.
        starts: poses `(n, 3)`: x, y [m], yaw [rad].
        task: what a trial is.
        disturbances: of each trial; None for ideal robots.
    """
    n, steps = len(starts), task.steps
    check_memory(f"{n:,} trials of {steps:,} control steps", n * steps * TRACK_BYTES)
    rows = {
        "pose": np.full((n, steps + 1, 3), np.nan),
        "command": np.full((n, steps, 2), np.nan),
        "fitness": np.full((n, steps), np.nan),
    }
    trials = _recorded(robots, policy, starts, task, disturbances, rows)
    return Tracks(steps=trials.steps, crashed=trials.crashed, **rows)


def record_trajectories(
    scene: Scene,
    policy: Policy,
    starts: np.ndarray,
    task: TaskParameters,
    disturbances: Disturbances | None = None,
) -> list[Trajectory]:
    """Record trajectories of a policy, one trial per start.

    Args:
        scene: robot and arena.
        policy: called with observations `(robots, 8)`, gives actions `(robots, 2)`.
        starts: poses `(n, 3)`: x, y [m], yaw [rad].
        task: what a trial is.
        disturbances: of each trial; None for ideal robots.
    """
    n, steps = len(starts), task.steps
    size = n * steps * TRAJECTORY_BYTES
    check_memory(f"{n:,} trials of {steps:,} control steps", size)
    rows = {
        "pose": np.zeros((n, steps + 1, 3)),
        "distance": np.zeros((n, steps + 1, N_PROXIMITY)),
        "proximity": np.zeros((n, steps + 1, N_PROXIMITY)),
        "observation": np.zeros((n, steps + 1, N_PROXIMITY)),
        "contact": np.zeros((n, steps + 1), bool),
        "action": np.zeros((n, steps, 2)),
        "command": np.zeros((n, steps, 2)),
        "fitness": np.zeros((n, steps)),
    }
    robots = robots_in(scene, max(1, n), 1)
    trials = _recorded(robots, Everybody(policy), starts, task, disturbances, rows)
    trajectories = []
    for i, lived in enumerate(trials.steps.tolist()):
        # readings have one row more than actions
        own = {
            name: array[i, : lived + array.shape[1] - steps].copy()
            for name, array in rows.items()
        }
        hidden = hidden_outputs(policy, own["observation"][:-1])
        time = np.arange(lived + 1) * task.control_step
        trajectories.append(Trajectory(time=time, hidden=hidden, **own))
    return trajectories


def record_lessons(
    robots: Simulator,
    policy: BatchPolicy,
    starts: np.ndarray,
    task: TaskParameters,
    disturbances: Disturbances | None = None,
) -> tuple[Trials, np.ndarray, np.ndarray]:
    """Trials `(n,)`, what was observed and what each step earned.

    Returns:
        The trials, observations `(n, steps, 8)` at the beginning of each control step,
        and step fitness `(n, steps)`; both are 0 after a trial's end.
    """
    n, steps = len(starts), task.steps
    rows = {
        "observation": np.zeros((n, steps + 1, N_PROXIMITY)),
        "fitness": np.zeros((n, steps)),
    }
    trials = _recorded(robots, policy, starts, task, disturbances, rows)
    # the last observation of a trial leads to no action
    ends = np.arange(n), trials.steps
    rows["observation"][ends] = 0.0
    return trials, rows["observation"][:, :-1], rows["fitness"]


def record(
    scene: Scene,
    policy: Policy,
    start: np.ndarray,
    task: TaskParameters,
    disturbances: Disturbances | None = None,
) -> Trajectory:
    """Record the trajectory of a policy from one start `(3,)`.

    The other arguments are those of `record_trajectories`.
    """
    starts = np.asarray(start, float)[None]
    return record_trajectories(scene, policy, starts, task, disturbances)[0]


def _recorded(
    robots: Simulator,
    policy: BatchPolicy,
    starts: np.ndarray,
    task: TaskParameters,
    disturbances: Disturbances | None,
    rows: Mapping[str, np.ndarray],
) -> Trials:
    """Run one trial per start and write each step into `rows`; the outcome."""
    parts = []
    for first in range(0, len(starts), robots.capacity):
        members = slice(first, first + robots.capacity)
        met = None if disturbances is None else disturbances[members]
        living = disturbed(robots, met, task.control_step)
        writer = _Writer(living, {name: array[members] for name, array in rows.items()})
        parts.append(
            run_trials(living, policy[members], starts[members], task, watcher=writer)
        )
    return Trials.joined(parts)


@dataclass(frozen=True)
class _Writer:
    """Writer of the quantities in `rows`; row 0 of sensed quantities is the start."""

    robots: Robots
    rows: Mapping[str, np.ndarray]

    def started(self, reading: Reading, observation: np.ndarray) -> None:
        self._sensed(0, slice(None), reading, observation)

    def stepped(self, k: int, active: np.ndarray, step: ControlStep) -> None:
        for name in ("action", "command", "fitness"):
            if name in self.rows:
                self.rows[name][active, k] = getattr(step, name)
        self._sensed(k + 1, active, step.reading, step.observation)

    def _sensed(
        self,
        row: int,
        active: np.ndarray | slice,
        reading: Reading,
        observation: np.ndarray,
    ) -> None:
        if "pose" in self.rows:
            self.rows["pose"][active, row] = self.robots.poses()
        if "observation" in self.rows:
            self.rows["observation"][active, row] = observation
        if "distance" not in self.rows:
            return
        truth = reading.distance if reading.truth is None else reading.truth
        counts = reading.proximity
        if counts is None:
            counts = np.rint(proximity(truth))
        self.rows["distance"][active, row] = truth
        self.rows["proximity"][active, row] = counts
        self.rows["contact"][active, row] = reading.contact
