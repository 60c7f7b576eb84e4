"""The table of runs, runs.csv: what each run found."""

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from evolution.judging.scores import HeldOut
from evolution.pages.words import robot_name
from evolution.report.measures import shown_robots
from evolution.study.columns import prefixes
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun

T = TypeVar("T")

Column = tuple[Callable[[T], Any], str, str]
"""How to get a value, its unit, and what it means."""

FITNESS = "fitness"
"""Stands for the unit of fitness, which names the highest fitness of a study."""


TEST_COLUMNS: Mapping[str, Column[HeldOut]] = {
    "mean": (lambda test: test.mean, FITNESS, "mean over the test starts"),
    "standard_deviation": (
        lambda test: test.standard_deviation,
        FITNESS,
        "standard deviation over the test starts",
    ),
    "mean_low": (
        lambda test: test.interval[0],
        FITNESS,
        "lower end of the bootstrap 95 % interval of the mean",
    ),
    "mean_high": (lambda test: test.interval[1], FITNESS, "its upper end"),
    "worst": (lambda test: test.worst, FITNESS, "mean of the worst 5 % of the starts"),
    "crash_rate": (lambda test: test.crash_rate, "share", "share of trials that crash"),
    "collisions_per_minute": (
        lambda test: test.collisions_per_minute,
        "1/min",
        "crashes per minute of driving",
    ),
    "following": (
        lambda test: test.following,
        "share",
        "share of trials of a wall follower or a hugger",
    ),
    "clearance_mean": (
        lambda test: test.clearance,
        "m",
        "mean clearance from shell to wall while a wall is near",
    ),
    "whole_lap": (
        lambda test: test.whole_laps,
        "share",
        "share of trials that go all round the arena",
    ),
    "starts": (lambda test: test.starts, "starts", "number of test starts"),
}
"""Columns of a held-out evaluation."""

RUN_COLUMNS: Mapping[str, Column[FinishedRun]] = {
    "stored": (
        lambda run: run.scores.stored,
        FITNESS,
        "stored fitness of the champion",
    ),
    "validation": (
        lambda run: run.scores.validation,
        FITNESS,
        "mean of the champion over the validation starts",
    ),
    "best_stored": (
        lambda run: float(run.history["best"].max()),
        FITNESS,
        "highest stored fitness of the run, which the paper reports",
    ),
    "evaluations": (
        lambda run: int(run.history["evaluations"][-1]),
        "evaluations",
        "individual evaluations spent",
    ),
    "control_steps": (
        lambda run: run.control_steps,
        "control steps",
        "control steps of all trials of evolution",
    ),
    "path": (lambda run: run.path.as_posix(), "", "name of the run for commands"),
}
"""Columns of a run beside its tests."""


def run_rows(data: StudyData) -> list[dict[str, Any]]:
    """A row per run with `described_columns`; None where a run has no such value."""
    return [
        _run_row(data, name, run)
        for name, runs in data.with_runs.items()
        for run in runs
    ]


def described_columns(data: StudyData) -> list[dict[str, str]]:
    """Name, unit and meaning of each column of `run_rows`, in their order."""
    found = {
        "experiment": ("", "name of the experiment"),
        "seed": ("", "seed of the run"),
    }
    for robot, prefix in prefixes(shown_robots(data)).items():
        for column, (_, unit, meaning) in TEST_COLUMNS.items():
            meaning = f"champion on the {robot_name(robot)}: {meaning}"
            found[f"{prefix}_{column}"] = (unit, meaning)
    for column, (_, unit, meaning) in RUN_COLUMNS.items():
        found[column] = (unit, meaning)
    unit_of = {FITNESS: f"fitness, at most {data.steps}"}
    return [
        {"column": column, "unit": unit_of.get(unit, unit), "meaning": meaning}
        for column, (unit, meaning) in found.items()
    ]


def _run_row(data: StudyData, name: str, run: FinishedRun) -> dict[str, Any]:
    row: dict[str, Any] = {"experiment": name, "seed": run.seed}
    for robot, prefix in prefixes(shown_robots(data)).items():
        test = run.scores.held_out[robot]
        for column, (value, _, _) in TEST_COLUMNS.items():
            row[f"{prefix}_{column}"] = value(test)
    row |= {column: value(run) for column, (value, _, _) in RUN_COLUMNS.items()}
    # nan stands for values that the champion's file does not have
    return {
        column: None if isinstance(value, float) and math.isnan(value) else value
        for column, value in row.items()
    }
