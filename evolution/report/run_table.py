"""The table of runs, runs.csv: what each run found."""

import csv
import math
from typing import Any

from evolution.report.measures import shown_robots
from evolution.run.directory import RunDirectory
from evolution.study.data import RunData, StudyData


def run_rows(data: StudyData) -> list[dict[str, Any]]:
    """A row per run; None where a run does not say.

    `<robot> ...` is the held-out evaluation on that robot: fitness of the test starts,
    bootstrap 95 % interval of its mean, mean of the worst 5 %, crashes per trial and
    per minute, share of trials that follow a wall, clearance [m], share of trials with
    a whole lap.
    """
    return [
        _run_row(data, name, run)
        for name, runs in data.with_runs.items()
        for run in runs
    ]


def _run_row(data: StudyData, name: str, run: RunData) -> dict[str, Any]:
    row: dict[str, Any] = {"experiment": name, "seed": run.seed}
    for robot in shown_robots(data):
        test = run.scores.held_out[robot]
        low, high = test.interval
        columns = {
            "mean": test.mean,
            "standard_deviation": test.standard_deviation,
            "mean_low": low,
            "mean_high": high,
            "worst": test.worst,
            "crash_rate": test.crash_rate,
            "collisions_per_minute": test.collisions_per_minute,
            "following": test.following,
            "clearance_mean": test.clearance,
            "whole_lap": test.whole_laps,
            "starts": test.starts,
        }
        row |= {f"{robot} {column}": value for column, value in columns.items()}
    row |= {
        "stored": run.scores.stored,
        "validation": run.scores.validation,
        "best_stored": float(run.history["best"].max()),
        "evaluations": int(run.history["evaluations"][-1]),
        "control_steps": control_steps(run),
        "path": run.path.as_posix(),
    }
    # nan is what the champion's file does not say
    return {
        column: None if isinstance(value, float) and math.isnan(value) else value
        for column, value in row.items()
    }


def control_steps(run: RunData) -> int | None:
    """Control steps that a run took, None if it did not count them."""
    try:
        with RunDirectory(run.path).timing.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(file)
            # in older files a generation that was done twice stands twice
            steps = {row["generation"]: int(row["control_steps"]) for row in rows}
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return sum(steps.values()) or None
