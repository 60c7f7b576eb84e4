"""Samples of a report: what an experiment's champions show, one value per run."""

import math
from collections.abc import Sequence

import numpy as np

from evolution.judging.scores import HeldOut
from evolution.statistics.targets import evaluations_to_target
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun

FOLLOWED = 0.9
"""Least share of a champion's trials that follow a wall without crashing."""

TARGET_SHARES: tuple[float, ...] = tuple(
    fitness / 300 for fitness in range(50, 250, 25)
)
"""Targets as shares of the highest fitness there is: 50, 75, ... 225 of 300."""


def tests_of(data: StudyData, name: str, robot: str) -> list[HeldOut]:
    """The held-out evaluations of an experiment's champions on a robot."""
    return [run.scores.held_out[robot] for run in data.runs[name]]


def crash_rates(tests: Sequence[HeldOut]) -> np.ndarray:
    """Share of the trials that crashed, of each held-out evaluation, `(n,)`."""
    return np.array([test.crash_rate for test in tests])


def known(values: Sequence[float]) -> np.ndarray:
    """The values that are not nan, `(n,)`."""
    return np.array([value for value in values if not math.isnan(value)])


def clearances(data: StudyData, name: str, robot: str) -> np.ndarray:
    """Mean clearance of each champion that was near a wall [m], `(n,)`."""
    return known([test.clearance for test in tests_of(data, name, robot)])


def whole_laps(data: StudyData, name: str, robot: str) -> np.ndarray:
    """Share of each champion's trials with a whole lap, `(n,)`."""
    return known([test.whole_laps for test in tests_of(data, name, robot)])


def class_means(data: StudyData, name: str, robot: str) -> dict[str, float]:
    """Mean share of each behaviour class over the runs that say; may be empty."""
    tests = tests_of(data, name, robot)
    each = [test.behaviour for test in tests if test.behaviour]
    classes = dict.fromkeys(name for shares in each for name in shares)
    return {
        name: float(np.mean([shares.get(name, 0.0) for shares in each]))
        for name in classes
    }


def kept(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Share of `whole` that `part` still has, `(n,)`, of the runs that had any."""
    some = whole > 0
    return part[some] / whole[some]


def with_noise(data: StudyData, name: str) -> bool:
    """Whether an experiment evolved on robots with noise."""
    return data.configs[name].noise != "none"


def best_stored_robot(data: StudyData) -> str:
    """The robot on which stored fitness is compared with tests.

    The one on which evolution ended, where individuals of the highest stored fitness
    were tested; the first that champions were tested on, if runs differ in it or do not
    say.
    """
    found = {
        best.robot
        for runs in data.with_runs.values()
        for run in runs
        if (best := run.scores.best_stored) is not None
    }
    (robot, *others) = found or {""}
    return robot if robot in data.robots and not others else data.robots[0]


def like_for_like(data: StudyData, name: str) -> np.ndarray:
    """Held-out fitness of champions as they evolved, `(n,)`; nan if not tested so."""
    robot = best_stored_robot(data)
    if not with_noise(data, name):
        return data.held_out(name, robot)
    return np.array([run.held_out_as_evolved(robot) for run in data.runs[name]])


def best_stored_fitness(data: StudyData, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Stored and held-out fitness of each run's highest stored individual, `(n,)`.

    Held-out on the robot of `best_stored_robot`; of the runs that say. None say of
    experiments with noise: theirs was tested on ideal robots only.
    """
    if with_noise(data, name):
        return np.empty(0), np.empty(0)
    found = [run.scores.best_stored for run in data.runs[name]]
    pairs = [(each.fitness, each.held_out) for each in found if each]
    stored, held_out = np.array(pairs, float).reshape(-1, 2).T
    return stored, held_out


def hits(runs: Sequence[FinishedRun], steps: int) -> np.ndarray:
    """Evaluations until each run reached each target, `(runs, targets)`; nan: never."""
    return np.array(
        [
            [
                evaluations_to_target(
                    run.history["evaluations"], run.history["best"], share * steps
                )
                for share in TARGET_SHARES
            ]
            for run in runs
        ]
    )


BUDGETS = (3_000, 6_000, 9_000, 15_000)
"""Evaluations after which best stored fitness is compared."""


def best_after(runs: Sequence[FinishedRun], budget: int) -> np.ndarray:
    """Best stored fitness after a number of evaluations, `(runs,)`; 0 if none yet."""
    return np.array(
        [
            run.history["best"][run.history["evaluations"] <= budget].max(initial=0)
            for run in runs
        ]
    )
