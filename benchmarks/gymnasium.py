"""Throughput of Gymnasium's vector environment: `python -m benchmarks.gymnasium`.

(a) the vector environment, stepped with actions drawn before: a loop of `step` only;
(b) compiled evaluation, which includes the paper's network.

Both on one thread, with the same number of robots from random starts, and control steps
that were lived. They are measured in turns; speeds and the ratio are medians over the
turns. Speeds are control steps per CPU-second, so they fall where other programs use
the same core.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from benchmarks.figures import write_figures
from epuck_mj.environments.gymnasium import ID
from epuck_mj.host.command_line import main, parse
from epuck_mj.policies.network import Network
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import START_CLEARANCE, TaskParameters
from evolution.judging.evaluation import BatchEngine, Work

N_STEPS = 300
TASK = TaskParameters(steps=N_STEPS)
N_ON_WHEELS = 64

OPTIONS: dict[str, dict[str, Any]] = {
    "ideal": {},
    "noise": {"noise": "calibrated"},
    "other_robots": {"noise": "calibrated", "randomise": True},
}


@dataclass(frozen=True)
class Options:
    """Measure the vector environment.

    Attributes:
        json: file for the figures.
        repeats: turns to measure.
        robots: number of robots.
    """

    json: Path | None = None
    repeats: int = 9
    robots: int = 1024


def measure_gymnasium(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.gymnasium", argv, Options())
    jobs = {
        name: _environment(options.robots, robot=KINEMATIC_ROBOT, **each)
        for name, each in OPTIONS.items()
    }
    jobs["evaluation"] = _evaluation(options.robots)
    jobs["wheels"] = _environment(N_ON_WHEELS, robot=WHEELED_ROBOT)
    turns = [
        {name: job() for name, job in jobs.items()} for _ in range(options.repeats)
    ]
    speeds = {
        f"steps_per_cpu_second_{name}": statistics.median(turn[name] for turn in turns)
        for name in jobs
    }
    shares = [turn["ideal"] / turn["evaluation"] for turn in turns]
    results = {
        "robots": options.robots,
        **speeds,
        "share_of_evaluation": statistics.median(shares),
    }
    for name, value in results.items():
        print(f"  {name:36} {value:12,.4g}")
    write_figures(options.json, results)
    return 0


def _rate(work: Callable[[], int]) -> float:
    """Control steps per CPU-second of work that returns their number."""
    begun = time.process_time()
    n_steps = work()
    return n_steps / (time.process_time() - begun)


def _environment(n: int, **options: Any) -> Callable[[], float]:
    """A vector environment, with actions that are random but forward."""
    env = gymnasium.make_vec(ID, num_envs=n, threads=1, **options)
    actions = np.random.default_rng(0).uniform((0, -1), (1, 1), (N_STEPS, n, 2))
    env.reset(seed=0)
    # compile
    env.step(actions[0])

    def work() -> int:
        for action in actions:
            env.step(action)
        return N_STEPS * n

    return lambda: _rate(work)


def _evaluation(n: int) -> Callable[[], float]:
    """Compiled trials of random networks."""
    scene = load_scene(KINEMATIC_ROBOT, "arena", TASK.control_step)
    engine = BatchEngine(scene, TASK, 1)
    rng = np.random.default_rng(0)
    starts = FreeSpace(scene, START_CLEARANCE).sample(rng, n)
    controller = Network().decode(rng.uniform(-5, 5, (n, Network().n_genes)))
    engine.run(Work(controller[:8], starts[:8]))
    work = Work(controller, starts)
    return lambda: _rate(lambda: int(engine.run(work).steps.sum()))


if __name__ == "__main__":
    main(measure_gymnasium)
