"""What is replayed: trials of policies on starts, and trajectories from files."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.show.recording import Trial
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.recorder import record_trajectories
from epuck_mj.trials.trajectory import Trajectory
from evolution.judging.starts import (
    N_TEST,
    N_VALIDATION,
    held_out_disturbances,
    starts_for_test,
    starts_for_validation,
)
from evolution.named_policies import NamedPolicy
from evolution.settings.randomness import Purpose

TRIALS_MAX = 50
"""Most trials of one recording: nobody could tell more apart."""


@dataclass(frozen=True)
class Starts:
    """Starts that trials begin from.

    Attributes:
        names: of each, `n` of them.
        poses: `(n, 3)`: x, y [m], yaw [rad].
        purpose: of the held-out starts that they are among.
        total: how many of these there are.
        first: number of the first among them.
    """

    names: tuple[str, ...]
    poses: np.ndarray
    purpose: Purpose = Purpose.TEST
    total: int = N_TEST
    first: int = 0

    @classmethod
    def none(cls) -> Self:
        """No starts, for recorded trajectories."""
        return cls((), np.zeros((0, 3)))

    @classmethod
    def from_pose(cls, pose: np.ndarray) -> Self:
        """The start that a person asks for, `(3,)`; it meets what test start 0 does."""
        return cls(("pose",), pose[None])

    def met(self, conditions: Conditions, steps: int) -> Disturbances | None:
        """What trials from here meet: as in the held-out test of all starts."""
        everything = held_out_disturbances(conditions, self.purpose, self.total, steps)
        if everything is None:
            return None
        return everything[self.first : self.first + len(self.names)]


def numbered_starts(spec: str, scene: Scene, clearance: float) -> Starts:
    """Starts that a person names, such as `test:0-9` or `validation:3`.

    Raises:
        UserError: if it names none.
    """
    sizes = {"test": N_TEST, "validation": N_VALIDATION}
    found = re.fullmatch(r"(\w+):(\d{1,9})(?:-(\d{1,9}))?", spec)
    if not found or found[1] not in sizes:
        raise UserError(
            f"expected starts such as test:0, test:0-9 or validation:7, got '{spec}'"
        )
    name, first, last = found[1], int(found[2]), int(found[3] or found[2])
    if not first <= last < sizes[name]:
        raise UserError(
            f"expected {name} starts from 0 to {sizes[name] - 1}, the lower number "
            f"first, got '{spec}'"
        )
    space = FreeSpace(scene, clearance)
    if name == "test":
        purpose, poses = Purpose.TEST, starts_for_test(space, last + 1)
    else:
        purpose, poses = Purpose.VALIDATION, starts_for_validation(space)
    names = tuple(f"{name} {i}" for i in range(first, last + 1))
    return Starts(names, poses[first : last + 1], purpose, sizes[name], first)


def simulated(
    scene: Scene,
    policies: Sequence[NamedPolicy],
    starts: Starts,
    conditions: Conditions | None = None,
) -> list[Trial]:
    """A trial of each policy on each start.

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
    # a trajectory does not say how long it might have been
    task = TaskParameters(steps=max(1, trajectory.steps))
    return Trial(Path(path).stem, trajectory, task)


def labels(policies: Sequence[NamedPolicy]) -> list[str]:
    """Short names of policies: the end of their paths, if that tells them apart."""
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
