"""What is replayed: trials of policies on starts, and trajectories from files."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.show.recording import Trial
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.trajectory import Trajectory, record
from evolution.judging.starts import (
    N_TEST,
    N_VALIDATION,
    starts_for_test,
    starts_for_validation,
)
from evolution.named_policies import NamedPolicy

TRIALS_MAX = 50
"""Most trials of one recording: nobody could tell more apart."""


def numbered_starts(spec: str, scene: Scene, clearance: float) -> dict[str, np.ndarray]:
    """Starts that a person names, `(3,)` each, such as `test:0-9` or `validation:3`.

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
        starts = starts_for_test(space, last + 1)
    else:
        starts = starts_for_validation(space)
    return {f"{name} {i}": starts[i] for i in range(first, last + 1)}


def simulated(
    scene: Scene, policies: Sequence[NamedPolicy], starts: dict[str, np.ndarray]
) -> list[Trial]:
    """A trial of each policy on each start, which has a name and a pose `(3,)`.

    Raises:
        UserError: if they are too many, or the robot touches a wall on a start.
    """
    if len(policies) * len(starts) > TRIALS_MAX:
        raise UserError(
            f"expected at most {TRIALS_MAX} trials, got {len(policies)} policies on "
            f"{len(starts)} starts"
        )
    trials = []
    for label, policy in zip(labels(policies), policies, strict=True):
        for name, start in starts.items():
            trajectory = record(scene, policy.policy, start, policy.task)
            if trajectory.contact[0]:
                x, y, yaw = start
                raise UserError(
                    f"expected a start where the robot touches nothing, got pose "
                    f"{x:g} {y:g} {np.degrees(yaw):g} in '{scene.arena}'"
                )
            words = [label] if len(policies) > 1 or len(starts) == 1 else []
            words += [name] if len(starts) > 1 else []
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
