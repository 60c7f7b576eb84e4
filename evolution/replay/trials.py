"""Replayed trials: of policies on starts, or from trajectory files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene
from epuck_mj.show.recording import Trial
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record_trajectories
from epuck_mj.trials.trajectory import Trajectory
from evolution.named_policies import NamedPolicy
from evolution.replay.choices import Starts

TRIALS_MAX = 50
"""Most trials of one recording: nobody could tell more apart."""


def simulated(
    scene: Scene,
    policies: Sequence[NamedPolicy],
    starts: Starts,
    conditions: Conditions | None = None,
) -> list[Trial]:
    """Simulate a trial of each policy on each start.

    Args:
        scene: robot and arena.
        policies: that drive.
        starts: from where.
        conditions: what the robots are like; None for those that a policy evolved with.

    Raises:
        UserError: if they are too many, or the robot touches a wall on a start.
    """
    n_starts = len(starts.names)
    if len(policies) * n_starts > TRIALS_MAX:
        raise UserError(
            f"expected at most {TRIALS_MAX} trials, got {len(policies)} policies on "
            f"{n_starts} starts"
        )
    trials = []
    for label, policy in zip(labels(policies), policies, strict=True):
        living, task = conditions or policy.conditions, policy.task
        met = starts.met(living, task.steps)
        trajectories = record_trajectories(
            scene, policy.policy, starts.poses, task, met
        )
        for i, (name, trajectory) in enumerate(
            zip(starts.names, trajectories, strict=True)
        ):
            if trajectory.contact[0]:
                x, y, yaw = starts.poses[i]
                raise UserError(
                    f"expected a start where the robot touches nothing, got pose "
                    f"{x:g} {y:g} {np.degrees(yaw):g} in '{scene.arena}'"
                )
            words = [label] if len(policies) > 1 or n_starts == 1 else []
            words += [name] if n_starts > 1 else []
            words += [str(living)] if met is not None else []
            trials.append(Trial(", ".join(words), trajectory, policy.task))
    return trials


def from_file(path: str) -> Trial:
    """The trial that a trajectory file holds, of a simulated or a real robot.

    Raises:
        UserError: if it is none.
    """
    trajectory = Trajectory.load(path)
    # a trajectory does not have the planned number of steps
    task = TaskParameters(steps=max(1, trajectory.steps))
    return Trial(Path(path).stem, trajectory, task)


def labels(policies: Sequence[NamedPolicy]) -> list[str]:
    """Short names of policies: the ends of their paths, if these differ."""
    sources = dict.fromkeys(policy.source for policy in policies)
    ends = {source: "/".join(Path(source).parts[-2:]) for source in sources}
    if len(set(ends.values())) < len(ends):
        ends = {source: source for source in sources}
    alone = len(sources) == 1
    return [
        policy.variant
        if alone and policy.variant
        else f"{ends[policy.source]} {policy.variant}".rstrip()
        for policy in policies
    ]
