"""Outcomes of champions in worlds, and on ideal robots."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from epuck_mj.rungs.simulator import Simulator
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.disturbances import Disturbances
from evolution.gap.side_by_side import SideBySide
from evolution.gap.worlds import World, met, starts_in
from evolution.judging.evaluation import CAPACITY, Work, run_work
from evolution.judging.held_out_starts import starts_for_test
from evolution.named_policies import NamedPolicy


@dataclass(frozen=True)
class Outcome:
    """Fitness and collisions of a policy in a world.

    Attributes:
        fitness: mean step fitness over the whole time of a trial, in [0, 1].
        collisions_per_minute: crashes per minute lived.
        crash_rate: share of the trials that ended in a crash.
    """

    fitness: float
    collisions_per_minute: float
    crash_rate: float


def check_nominal(policies: Sequence[NamedPolicy], robots: Sequence[str]) -> None:
    """Refuse robots and arenas that cannot be used, before the work is done.

    Raises:
        UserError: for such a robot or arena.
    """
    for robot in robots:
        for policy in policies:
            scene = load_scene(robot, policy.arena, policy.task.control_step)
            FreeSpace(scene, policy.start_clearance)
            robots_in(scene, 1)


def ideal(
    policies: Sequence[NamedPolicy],
    robot: str,
    n: int,
    threads: int,
    arena: str | None = None,
) -> list[Outcome]:
    """Outcomes of policies on ideal robots, on `n` test starts.

    Each drives in `arena`, or in the one that it evolved in if that is None.
    """
    found: dict[int, Outcome] = {}
    groups = _alike(
        policies,
        lambda each: (arena or each.arena, each.start_clearance, each.task),
    )
    for (place, clearance, task), members in groups.items():
        scene = load_scene(robot, place, task.control_step)
        starts = starts_for_test(FreeSpace(scene, clearance), n)
        robots = robots_in(scene, min(n * len(members), CAPACITY), threads)
        found |= _outcomes(policies, members, robots, starts, task, None)
    return [found[i] for i in range(len(policies))]


def in_worlds(
    policies: Sequence[NamedPolicy],
    worlds: Sequence[World],
    robot: str,
    n: int,
    threads: int,
) -> Iterator[list[Outcome]]:
    """Outcomes of all policies in each world, on `n` starts of its own.

    They all meet the same robot and the same noise. A trial lasts as long as in
    evolution.
    """
    groups = _alike(policies, lambda each: (each.start_clearance, each.task))
    most = max(map(len, groups.values()))
    for world in worlds:
        scene, period = _scene(world, robot)
        robots = robots_in(scene, min(n * most, CAPACITY), threads)
        free = cache(partial(FreeSpace, scene))
        found: dict[int, Outcome] = {}
        for (clearance, own), members in groups.items():
            steps = max(1, round(own.steps * own.control_step / period))
            task = replace(own, steps=steps, control_step=period)
            starts, robot_met = (
                starts_in(world, free(clearance), n),
                met(world, n, steps),
            )
            found |= _outcomes(policies, members, robots, starts, task, robot_met)
        yield [found[i] for i in range(len(policies))]


def _alike(
    policies: Sequence[NamedPolicy], common: Callable[[NamedPolicy], Any]
) -> dict[Any, list[int]]:
    """Numbers of policies by what they have in common."""
    found: dict[Any, list[int]] = {}
    for i, policy in enumerate(policies):
        found.setdefault(common(policy), []).append(i)
    return found


def _outcomes(
    policies: Sequence[NamedPolicy],
    members: Sequence[int],
    robots: Simulator,
    starts: np.ndarray,
    task: TaskParameters,
    disturbances: Disturbances | None,
) -> dict[int, Outcome]:
    """Outcomes of some policies by number, all from the same starts `(n, 3)`."""
    n, many = len(starts), len(members)
    work = Work(
        SideBySide.of([policies[i].policy for i in members], n),
        np.tile(starts, (many, 1)),
        disturbances=None if disturbances is None else disturbances.tiled(many),
    )
    trials = run_work(robots, work, task)
    fitness, steps, crashed = (
        each.reshape(many, n) for each in (trials.fitness, trials.steps, trials.crashed)
    )
    lived = steps.sum(axis=-1) * task.control_step
    return {
        number: Outcome(
            # after a crash, the rest of the time earns nothing
            fitness=float(fitness[i].mean() / task.steps),
            collisions_per_minute=float(60 * crashed[i].sum() / lived[i]),
            crash_rate=float(crashed[i].mean()),
        )
        for i, number in enumerate(members)
    }


def _scene(world: World, robot: str) -> tuple[Scene, float]:
    """A world's scene, and its period, rounded to whole physics steps [s]."""
    step = load_scene(robot, world.arena).model.opt.timestep
    period = round(max(1, round(world.period / step)) * step, 9)
    return load_scene(robot, world.arena, period), period
