"""Scene and starts of replayed trials, as asked for."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.geometry import arena_box
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import Everybody
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.recorder import record_tracks
from evolution.judging.held_out_starts import (
    held_out_disturbances,
    starts_for_test,
    starts_for_validation,
)
from evolution.named_policies import NamedPolicy, common_wheels
from evolution.replay.options import Options
from evolution.settings.config_fields import N_TEST, N_VALIDATION
from evolution.settings.randomness import Purpose

N_TRIED = 25
"""Test starts among which the one of median fitness is shown."""


@dataclass(frozen=True)
class Starts:
    """Starts of replayed trials.

    Attributes:
        names: of each, `n` of them.
        poses: `(n, 3)`: x, y [m], yaw [rad].
        purpose: of the held-out starts that they are among.
        first: number of the first among them.
        typical_of: number of test starts among which the first policy has its median
            fitness on this one; 0 if the starts were not chosen by fitness.
    """

    names: tuple[str, ...]
    poses: np.ndarray
    purpose: Purpose = Purpose.TEST
    first: int = 0
    typical_of: int = 0

    def met(self, conditions: Conditions, steps: int) -> Disturbances | None:
        """Disturbances of trials from these starts, as in the held-out test."""
        end = self.first + len(self.names)
        met = held_out_disturbances(conditions, self.purpose, end, steps)
        return None if met is None else met[self.first :]


def numbered_starts(spec: str, scene: Scene, clearance: float) -> Starts:
    """Starts by name, such as `test:0-9` or `validation:3`.

    Raises:
        UserError: if `spec` names no starts.
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
    return Starts(names, poses[first : last + 1], purpose, first)


def scene_for(options: Options, policies: Sequence[NamedPolicy]) -> Scene:
    """The scene in which all policies drive.

    Raises:
        UserError: if the policies do not agree on it.
    """
    arenas = dict.fromkeys(policy.arena for policy in policies) or {"arena": None}
    if options.arena is None and len(arenas) > 1:
        raise UserError(
            f"the policies evolved in different arenas ({', '.join(arenas)}): expected "
            "--arena with the arena in which to compare them"
        )
    control_steps = {policy.task.control_step for policy in policies} or {0.1}
    if len(control_steps) > 1:
        raise UserError(
            f"expected policies with the same control step, got {sorted(control_steps)}"
        )
    arena = options.arena or next(iter(arenas))
    robot = options.robot or common_wheels(policies)
    return load_scene(robot, arena, control_steps.pop())


def starts_for(
    options: Options, scene: Scene, policies: Sequence[NamedPolicy]
) -> Starts:
    """The starts that were asked for.

    Raises:
        UserError: if they are no starts, or asked for in several ways.
    """
    ways = (options.trials, options.starts, options.pose or None)
    if sum(way is not None for way in ways) > 1:
        raise UserError("expected one of --trials, --starts and --pose, got several")
    if not policies and (any(ways) or options.generations is not None):
        raise UserError(
            "expected a policy with --trials, --starts, --pose or --generations, got a "
            "recorded trajectory"
        )
    if options.pose:
        if len(options.pose) != 3 or not np.isfinite(options.pose).all():
            raise UserError(
                "expected --pose with x [m], y [m] and heading [degrees], got "
                + " ".join(f"{number:g}" for number in options.pose)
            )
        # it has the disturbances of test start 0
        return Starts(("pose",), _pose(scene, *options.pose)[None])
    if options.trials is not None and options.trials < 1:
        raise UserError(f"expected at least 1 trial, got {options.trials}")
    if not policies:
        # recorded trajectories need no starts
        return Starts((), np.zeros((0, 3)))
    # the largest clearance: a start that is free with it is free for all
    clearance = max(policy.start_clearance for policy in policies)
    if options.starts is not None:
        return numbered_starts(options.starts, scene, clearance)
    if options.trials is not None:
        return numbered_starts(f"test:0-{options.trials - 1}", scene, clearance)
    number = typical_start(scene, policies[0], clearance, options.robots.conditions)
    starts = numbered_starts(f"test:{number}", scene, clearance)
    return replace(starts, typical_of=N_TRIED)


def typical_start(
    scene: Scene,
    policy: NamedPolicy,
    clearance: float,
    conditions: Conditions | None = None,
) -> int:
    """Number of the start of median fitness, among the first test starts.

    Args:
        scene: robot and arena.
        policy: that drives.
        clearance: least distance from the shell to a wall at a start [m].
        conditions: of the robots; None for those that the policy evolved with.
    """
    starts = numbered_starts(f"test:0-{N_TRIED - 1}", scene, clearance)
    met = starts.met(conditions or policy.conditions, policy.task.steps)
    robots, everybody = robots_in(scene, N_TRIED), Everybody(policy.policy)
    tracks = record_tracks(robots, everybody, starts.poses, policy.task, met)
    order = np.argsort(tracks.trial_fitness, kind="stable")
    return int(order[N_TRIED // 2])


def _pose(scene: Scene, x: float, y: float, degrees: float) -> np.ndarray:
    """A pose `(3,)`, refused outside the walls."""
    lower, upper = arena_box(scene.model)
    if not ((lower[:2] <= (x, y)) & ((x, y) <= upper[:2])).all():
        raise UserError(
            f"expected --pose in the arena, x from {lower[0]:g} to {upper[0]:g} and y "
            f"from {lower[1]:g} to {upper[1]:g}, got {x:g} {y:g}"
        )
    return np.array([x, y, math.radians(math.remainder(degrees, 360))])
