"""The table of champions for real robots: on other robots, with noise and latency."""

from collections.abc import Sequence

import numpy as np

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.judging.scores import HeldOut
from evolution.pages.blocks import Table
from evolution.pages.words import label, percent
from evolution.study.data import StudyData

COLUMNS = (
    "experiment",
    "runs",
    "full speed [m/s]",
    "fitness a step, disturbed",
    "lowest",
    "crashes, disturbed [%]",
    "most",
    "fitness a step, ideal",
    "crashes, ideal [%]",
)


def real_robots_table(study: StudyData) -> Table:
    """Tests on wheels of the champions of each experiment: medians, and the worst."""
    rows = []
    for name, runs in study.with_runs.items():
        disturbed = [
            run.scores.held_out_as_evolved[WHEELED_ROBOT]
            for run in runs
            if WHEELED_ROBOT in run.scores.held_out_as_evolved
        ]
        ideal = [run.scores.held_out[WHEELED_ROBOT] for run in runs]
        config = study.configs[name]
        worth, crashes = _of(disturbed, config.steps)
        worth_ideal, crashes_ideal = _of(ideal, config.steps)
        rows.append(
            (
                label(study, name),
                str(len(runs)),
                f"{config.v_max:.3g}",
                f"{np.median(worth):.2f}",
                f"{worth.min():.2f}",
                percent(float(np.median(crashes))),
                percent(float(crashes.max())),
                f"{np.median(worth_ideal):.2f}",
                percent(float(np.median(crashes_ideal))),
            )
        )
    return Table(COLUMNS, rows)


def _of(tests: Sequence[HeldOut], steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Fitness a step and crash rate of each test, `(n,)`; nan without any."""
    if not tests:
        return np.full(1, np.nan), np.full(1, np.nan)
    worth = np.array([test.mean / steps for test in tests])
    return worth, np.array([test.crash_rate for test in tests])
