"""What experiments are compared by: measures, and the robots in the order of tables."""

import numpy as np

from epuck_mj.scene.model_files import is_on_wheels
from evolution.pages.words import robot_name
from evolution.study.data import StudyData

BEST_STORED = "best stored"
"""Measure of the paper: the highest fitness that a run stored."""

BOOTSTRAP_SEED = 0
"""Seed of the resamples of each interval: none depends on the rows before it."""


def generator() -> np.random.Generator:
    """Draws the resamples of one interval."""
    return np.random.default_rng(BOOTSTRAP_SEED)


def shown_robots(data: StudyData) -> tuple[str, ...]:
    """The robots in the order of every table: the one on wheels first."""
    return tuple(sorted(data.robots, key=lambda robot: not is_on_wheels(robot)))


def held_out_measure(robot: str) -> str:
    """What held-out fitness on a robot is called in the tables."""
    return f"held-out {robot}"


def measures(data: StudyData) -> dict[str, dict[str, np.ndarray]]:
    """Samples `(runs,)` by experiment with runs, of each measure: held-out first."""
    found = {
        held_out_measure(robot): {n: data.held_out(n, robot) for n in data.with_runs}
        for robot in shown_robots(data)
    }
    return found | {
        BEST_STORED: {name: data.best_stored(name) for name in data.with_runs}
    }


def measure_title(measure: str, data: StudyData) -> str:
    """A measure for readers."""
    titles = {
        held_out_measure(robot): f"Held-out fitness, {robot_name(robot)}"
        for robot in data.robots
    }
    return titles.get(measure, "Best stored fitness, what the paper reports")
