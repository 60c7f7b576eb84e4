"""The table of champions for real robots: on other robots, with noise and latency."""

import numpy as np

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.pages.blocks import Table
from evolution.pages.words import label, percent, percent_median
from evolution.report.samples import crash_rates, tests_of
from evolution.study.data import StudyData

COLUMNS = (
    "experiment",
    "runs",
    "full speed [m/s]",
    "fitness a step, disturbed",
    "of the worst run",
    "crashes, disturbed [%]",
    "of the worst run [%]",
    "fitness a step, ideal",
    "crashes, ideal [%]",
)


def real_robots_table(study: StudyData) -> Table:
    """Tests on wheels of the champions of each experiment: medians, and the worst.

    Args:
        study: whose experiments all have noise.
    """
    rows = []
    for name, runs in study.with_runs.items():
        disturbed = [run.scores.held_out_as_evolved[WHEELED_ROBOT] for run in runs]
        ideal = tests_of(study, name, WHEELED_ROBOT)
        config = study.configs[name]
        worth, worth_ideal = (
            np.array([test.mean for test in tests]) / config.steps
            for tests in (disturbed, ideal)
        )
        crashes = crash_rates(disturbed)
        rows.append(
            (
                label(study, name),
                str(len(runs)),
                f"{config.v_max:.3g}",
                f"{np.median(worth):.2f}",
                f"{worth.min():.2f}",
                percent_median(crashes),
                percent(float(crashes.max())),
                f"{np.median(worth_ideal):.2f}",
                percent_median(crash_rates(ideal)),
            )
        )
    return Table(COLUMNS, rows)
