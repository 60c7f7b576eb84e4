"""The table of runs, runs.csv: what each run found."""

import csv
from typing import Any

from evolution.report.measures import shown_robots
from evolution.report.samples import clearance, following_share, whole_lap_share
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
        test = run.champion.scores["held_out"][robot]
        low, high = test.get("interval") or (None, None)
        columns = {
            "mean": test["mean"],
            "standard_deviation": test.get("standard_deviation"),
            "mean_low": low,
            "mean_high": high,
            "worst": test.get("worst"),
            "crash_rate": test.get("crash_rate"),
            "collisions_per_minute": test.get("collisions_per_minute"),
            "following": following_share(test) if test.get("behaviour") else None,
            "clearance_mean": clearance(test),
            "whole_lap": whole_lap_share(test),
            "starts": test.get("starts"),
        }
        row |= {f"{robot} {column}": value for column, value in columns.items()}
    return row | {
        "stored": run.stored,
        "validation": run.champion.scores.get("validation"),
        "best_stored": float(run.history["best"].max()),
        "evaluations": int(run.history["evaluations"][-1]),
        "control_steps": control_steps(run),
        "path": run.path.as_posix(),
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
