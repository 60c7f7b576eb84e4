"""Outcomes of champions in worlds, and on ideal robots."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import Everybody
from epuck_mj.trials.recorder import record_tracks
from epuck_mj.trials.tracks import Tracks
from evolution.gap.worlds import World, met, starts_in
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


def check_homes(policies: Sequence[NamedPolicy], robots: Sequence[str]) -> None:
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
    scenes = cache(lambda arena, step: load_scene(robot, arena, step))
    free = cache(FreeSpace)
    outcomes = []
    for policy in policies:
        scene = scenes(arena or policy.arena, policy.task.control_step)
        robots = robots_in(scene, n, threads)
        starts = starts_for_test(free(scene, policy.start_clearance), n)
        everybody = Everybody(policy.policy)
        tracks = record_tracks(robots, everybody, starts, policy.task)
        outcomes.append(_outcome(tracks, policy.task.control_step))
    return outcomes


def abroad(
    policies: Sequence[NamedPolicy],
    worlds: Sequence[World],
    robot: str,
    n: int,
    threads: int,
) -> Iterator[list[Outcome]]:
    """Outcomes of all policies in each world, on `n` starts of its own.

    They all meet the same robot and the same noise; a trial lasts as long as at home.
    """
    for world in worlds:
        scene, period = _scene(world, robot)
        robots = robots_in(scene, n, threads)
        # slow, and the same for most policies
        free = cache(FreeSpace)
        outcomes = []
        for policy in policies:
            duration = policy.task.steps * policy.task.control_step
            steps = max(1, round(duration / period))
            task = replace(policy.task, steps=steps, control_step=period)
            starts = starts_in(world, free(scene, policy.start_clearance), n)
            tracks = record_tracks(
                robots,
                Everybody(policy.policy),
                starts,
                task,
                met(world, n, steps),
            )
            outcomes.append(_outcome(tracks, period))
        yield outcomes


def _scene(world: World, robot: str) -> tuple[Scene, float]:
    """A world's scene, and its period, rounded to whole physics steps [s]."""
    step = load_scene(robot, world.arena).model.opt.timestep
    period = round(max(1, round(world.period / step)) * step, 9)
    return load_scene(robot, world.arena, period), period


def _outcome(tracks: Tracks, period: float) -> Outcome:
    lived = tracks.steps.sum() * period
    duration = tracks.fitness.shape[1] * period
    return Outcome(
        # after a crash, the rest of the time earns nothing
        fitness=float(tracks.trial_fitness.mean() * period / duration),
        collisions_per_minute=float(60 * tracks.crashed.sum() / lived),
        crash_rate=float(tracks.crashed.mean()),
    )
