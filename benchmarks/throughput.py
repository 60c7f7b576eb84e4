"""Throughput of evaluation against MuJoCo's own limit: `make bench`.

(a) a plain loop in C, `mj_step(model, data, nstep)`, on the compiled scene: the limit;
(b) our batch evaluator with the 8-4-2 policy and fitness, on 1 and on 2 threads;
(c) a straightforward dm_control episode loop with the same policy.

And the kinematic robot against wheels: see `kinematic`.

Shared machines are noisy, so the three are measured in turns and only ratios of one
turn count; the medians over all turns are reported. Shares of one core are ratios of
CPU time; what two threads gain is wall time and wants an idle machine.
"""

import itertools
import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from dm_control.rl import control

from benchmarks.figures import write_figures
from benchmarks.kinematic import circling, measure_kinematic
from epuck_mj.environments.dm_control import FollowWalls, environment
from epuck_mj.host.command_line import main, parse
from epuck_mj.policies.network import Controller
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters
from evolution.judging.evaluation import BatchEngine, Work

N_ROBOTS = 750
"""A generation of DE/best: 150 individuals on 5 starts."""


@dataclass(frozen=True)
class Options:
    """Measure throughput.

    Attributes:
        json: file for the figures.
        repeats: turns to measure.
    """

    json: Path | None = None
    repeats: int = 9


@dataclass(frozen=True)
class Rate:
    """Physics steps per second, by the wall and by the CPU."""

    wall: float
    cpu: float


@dataclass(frozen=True)
class Turn:
    """One measurement of each, close together in time."""

    mj_step: Rate
    batch_1: Rate
    batch_2: Rate
    dm_control: Rate


def measure_throughput(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.throughput", argv, Options())
    results = {}
    for robot, measured in (
        (WHEELED_ROBOT, measure_wheels),
        (KINEMATIC_ROBOT, measure_kinematic),
    ):
        results[robot] = measured(options.repeats)
        print(robot)
        for name, value in results[robot].items():
            print(f"  {name:36} {value:10.4g}")
    write_figures(options.json, results)
    return 0


def measure_wheels(repeats: int) -> dict[str, float]:
    """Medians of the ratios of interleaved repeats, on wheels in MuJoCo."""
    scene = load_scene(WHEELED_ROBOT, "arena")
    # small circles: no robot crashes
    task = TaskParameters(steps=100)
    starts = FreeSpace(scene, 0.12).sample(np.random.default_rng(0), N_ROBOTS)
    controller = circling(N_ROBOTS)
    one, two = (BatchEngine(scene, task, threads) for threads in (1, 2))
    whole, n_substeps = TaskParameters(), scene.n_substeps
    env = environment(scene, FollowWalls(scene, whole, starts=itertools.cycle(starts)))
    turns = [
        Turn(
            mj_step=_rate(lambda: _mj_step(scene)),
            batch_1=_rate(lambda: _batch(one, controller, starts, task) * n_substeps),
            batch_2=_rate(lambda: _batch(two, controller, starts, task) * n_substeps),
            dm_control=_rate(lambda: _dm_control(env, controller)),
        )
        for _ in range(repeats)
    ]

    def median(figure: Callable[[Turn], float]) -> float:
        return statistics.median(figure(turn) for turn in turns)

    step = scene.model.opt.timestep
    return {
        "share_of_mj_step": median(lambda t: t.batch_1.cpu / t.mj_step.cpu),
        "thread_scaling": median(lambda t: t.batch_2.wall / t.batch_1.wall),
        "over_dm_control": median(lambda t: t.batch_2.wall / t.dm_control.wall),
        "simulated_seconds_per_cpu_second": median(lambda t: t.batch_1.cpu * step),
        "mj_step_microseconds": median(lambda t: 1e6 / t.mj_step.cpu),
        "physics_step_seconds": step,
        "cores": os.cpu_count() or 1,
    }


def _rate(work: Callable[[], int]) -> Rate:
    """Speed of work that returns its number of physics steps."""
    wall, cpu = time.perf_counter(), time.process_time()
    n_steps = work()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return Rate(n_steps / wall, n_steps / cpu)


def _mj_step(scene: Scene, n_steps: int = 50_000) -> int:
    """The limit: one robot drives a circle of 13 cm, all in C."""
    data = mujoco.MjData(scene.model)
    mujoco.mj_forward(scene.model, data)
    data.ctrl[scene.wheels] = 2.0, 3.0
    mujoco.mj_step(scene.model, data, n_steps)
    return n_steps


def _batch(
    engine: BatchEngine,
    controller: Controller,
    starts: np.ndarray,
    task: TaskParameters,
) -> int:
    """Control steps of our evaluator: a generation, policy and fitness included."""
    trials = engine.run(Work(controller, starts))
    assert trials.steps.min() == task.steps, "a crash would spoil the measurement"
    return int(trials.steps.sum())


def _dm_control(
    env: control.Environment, controller: Controller, episodes: int = 5
) -> int:
    """A plain dm_control loop over whole episodes."""
    n_steps = 0
    for i in range(episodes):
        policy, time_step = controller[i], env.reset()
        while not time_step.last():
            time_step = env.step(policy(time_step.observation["proximity"]))
            n_steps += 1
    return n_steps * round(env.control_timestep() / env.physics.timestep())


if __name__ == "__main__":
    main(measure_throughput)
