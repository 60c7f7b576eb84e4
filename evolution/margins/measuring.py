"""Measuring: policies on changed robots."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from epuck_mj.policies.topology import Topology
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import Everybody, Policy
from evolution.judging.evaluation import BatchEngine, Work, evaluate
from evolution.judging.held_out_starts import starts_for_test
from evolution.margins.changes import CHANGES
from evolution.settings.setting import Setting


class Margin(NamedTuple):
    """What policies earn on one changed robot.

    Attributes:
        change: name in `CHANGES`.
        amount: in the unit of the change.
        fitness: mean over the starts, `(policies,)`.
        crash_rate: share of the trials that ended in a crash, `(policies,)`.
    """

    change: str
    amount: float
    fitness: np.ndarray
    crash_rate: np.ndarray


def margins_of_genomes(
    setting: Setting,
    topology: Topology,
    genomes: np.ndarray,
    n: int,
    threads: int = 0,
    robot: str = KINEMATIC_ROBOT,
) -> Iterator[Margin]:
    """Networks on every changed robot, on the first test starts.

    Args:
        setting: in which they evolved.
        topology: what their genomes decode to.
        genomes: `(policies, genes)`.
        n: number of starts.
        threads: that step the robots; 0 is one per core.
        robot: kinematic robot that is changed.

    Raises:
        UserError: if the kinematic robot cannot drive in the arena.
    """

    def run(engine: BatchEngine, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = evaluate(engine, topology, genomes, starts)
        return found.fitness, found.crashed.mean(axis=-1)

    return _margins(setting, n, threads, robot, run)


def margins_of_policy(
    setting: Setting,
    policy: Policy,
    n: int,
    threads: int = 0,
    robot: str = KINEMATIC_ROBOT,
) -> Iterator[Margin]:
    """One policy of any kind on every changed robot; see `margins_of_genomes`."""

    def run(engine: BatchEngine, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        trials = engine.run(Work(Everybody(policy), starts))
        return trials.fitness.mean(keepdims=True), trials.crashed.mean(keepdims=True)

    return _margins(setting, n, threads, robot, run)


Run = Callable[[BatchEngine, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Gives fitness and crash rates, `(policies,)`, on starts `(n, 3)`."""


def _margins(
    setting: Setting, n: int, threads: int, robot: str, run: Run
) -> Iterator[Margin]:
    task = setting.task
    scene = load_scene(robot, setting.arena, task.control_step)
    # the same starts for all changes: poses where the robot of evolution has room
    starts = starts_for_test(FreeSpace(scene, setting.start_clearance), n)
    for name, change in CHANGES.items():
        for amount in change.amounts:
            late = int(amount) if change.late else 0
            engine = BatchEngine(change.scene(scene, amount), task, threads, late)
            yield Margin(name, amount, *run(engine, starts))
