"""Held-out fitness: the main table, and the same with noise."""

import numpy as np

from evolution.pages.blocks import Block, Heading, Paragraph, Table
from evolution.pages.words import (
    NOTHING,
    SPREAD,
    YARDSTICK_LABEL,
    label,
    percent,
    percent_median,
    robot_name,
    spread,
)
from evolution.report.measures import shown_robots
from evolution.report.samples import crash_rates, tests_of
from evolution.study.data import StudyData


def held_out_fitness_section(data: StudyData) -> list[Block]:
    """The main table: held-out fitness first."""
    robots = shown_robots(data)
    rows = []
    for name, runs in data.with_runs.items():
        row = [label(data, name), str(len(runs))]
        for robot in robots:
            sample = data.held_out(name, robot)
            crashes = crash_rates(tests_of(data, name, robot))
            row += [spread(sample), f"{sample.max():.1f}", percent_median(crashes)]
        rows.append([*row, spread(data.best_stored(name))])
    if data.yardstick:
        row = [YARDSTICK_LABEL, NOTHING]
        for robot in robots:
            test = data.yardstick[robot]
            row += [f"{test.mean:.1f}", NOTHING, percent(test.crash_rate)]
        rows.append([*row, NOTHING])
    unit = f"[of {data.steps}]"
    columns = ["experiment", "runs"]
    for robot in robots:
        who = robot_name(robot)
        columns += [
            f"{who}: held-out {unit}",
            f"{who}: best run {unit}",
            f"{who}: crashes [%]",
        ]
    return [
        Heading("Held-out fitness"),
        Paragraph(
            f"{SPREAD} of the champion's mean on the test starts, the best run, and "
            "the median share of its trials that crash. The last column, best stored, "
            "is the highest fitness that a run stored. It is the mean of a few trials, "
            "and it was chosen because it is high, so it includes luck. The paper "
            "reports this number. It is seldom the champion's."
        ),
        Table([*columns, f"best stored {unit}"], rows),
        *_as_evolved(data),
    ]


def _as_evolved(data: StudyData) -> list[Block]:
    """Held-out fitness on disturbed robots, of experiments that evolved on such."""
    rows = []
    for name, runs in data.with_runs.items():
        found = [run.scores.held_out_as_evolved for run in runs]
        tests = [each for each in found if each]
        if tests:
            row = [label(data, name), str(len(tests))]
            for robot in shown_robots(data):
                on_robot = [each[robot] for each in tests]
                row.append(spread(np.array([test.mean for test in on_robot])))
                row.append(percent_median(crash_rates(on_robot)))
            rows.append(row)
    if not rows:
        return []
    columns = ["experiment", "runs"]
    for robot in shown_robots(data):
        who = robot_name(robot)
        columns += [f"{who}: held-out [of {data.steps}]", f"{who}: crashes [%]"]
    return [
        Paragraph(
            "The same for experiments that evolved with disturbances, tested with "
            "these disturbances: noise and, where the config says so, randomised "
            "robots."
        ),
        Table(columns, rows),
    ]
