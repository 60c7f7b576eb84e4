"""Measurement of a scene's speed on this computer."""

import time
from collections.abc import Iterator

import numpy as np

from epuck_mj.check.findings import Finding, info
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene
from epuck_mj.step.control import ControlStep, TaskParameters, drive

MEASURED = 0.15
"""Duration of each of the two measurements [s]."""


def speed_findings(scene: Scene, start: np.ndarray, topic: str) -> list[Finding]:
    """Steps per second of one robot on one thread, from a start `(3,)` on.

    Args:
        scene: robot and arena.
        start: where the robot starts, and starts again after a crash.
        topic: heading of the findings.
    """
    task = TaskParameters()
    physics, _ = _rates(_standing(scene, start))
    control, per_cpu = _rates(_driving(scene, start, task))
    n = scene.n_substeps
    return [
        info(
            topic,
            f"a control step of {task.control_step:g} s is {n} physics steps of "
            f"{scene.model.opt.timestep:g} s",
        ),
        info(
            topic,
            f"speed, measured now with one robot on one thread: {physics * n:,.0f} "
            f"physics steps/s; {control:,.0f} control steps/s with a controller, which "
            f"is {per_cpu * task.control_step:,.0f} simulated s per CPU second",
        ),
    ]


def _standing(scene: Scene, start: np.ndarray) -> Iterator[None]:
    """Endless control steps of a robot that is told to stand still."""
    robots = robots_in(scene, 1, 1)
    robots.reset(start[None])
    while True:
        robots.step(np.zeros((1, 2)))
        yield


def _driving(
    scene: Scene, start: np.ndarray, task: TaskParameters
) -> Iterator[ControlStep]:
    """Endless control steps of a robot with a controller."""
    robots, policy = robots_in(scene, 1, 1), WallFollower()
    while True:
        yield from drive(robots, policy, robots.reset(start[None]), task)


def _rates(steps: Iterator[object]) -> tuple[float, float]:
    """Steps per second, and per second of CPU time."""
    start, cpu, n = time.perf_counter(), time.process_time(), 0
    while (elapsed := time.perf_counter() - start) < MEASURED:
        next(steps)
        n += 1
    return n / elapsed, n / max(time.process_time() - cpu, 1e-9)
