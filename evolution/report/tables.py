"""The tables of a report: what each run found, and what each target cost."""

import csv
import math
import shlex
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.report.samples import TARGET_SHARES, hits
from evolution.run.directory import RunDirectory
from evolution.statistics.targets import expected_running_time_interval
from evolution.study.data import RunData, StudyData

BOOTSTRAP_SEED = 0
"""Of the resamples of each interval, so that none depends on the rows before it."""

STORED, BEST_STORED = "stored", "best stored"
"""What evolution believes: of the champion, and of the best of the run."""


def generator() -> np.random.Generator:
    """Draws the resamples of one interval."""
    return np.random.default_rng(BOOTSTRAP_SEED)


def shown_robots(data: StudyData) -> tuple[str, ...]:
    """The robots in the order of every table: the one on wheels first."""
    return tuple(sorted(data.robots, key=lambda robot: robot != WHEELED_ROBOT))


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
        STORED: run.scores.stored,
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


@dataclass(frozen=True)
class TargetRow:
    """What a target cost an experiment.

    Attributes:
        experiment: its name.
        target: fitness to reach.
        share: the same, of the highest fitness there is.
        fitness: which fitness: always the stored one, since a history has no other.
        hits: runs that reached it.
        n: runs.
        expected_running_time: evaluations per success, inf if no run reached it.
        expected_running_time_low: bootstrap 95 % bound, nan below 5 runs.
        expected_running_time_high: likewise.
        median_evaluations: of the runs that reached it, None if none did.
    """

    experiment: str
    target: float
    share: float
    fitness: str
    hits: int
    n: int
    expected_running_time: float
    expected_running_time_low: float
    expected_running_time_high: float
    median_evaluations: float | None


def target_rows(data: StudyData) -> list[TargetRow]:
    """A row per experiment with runs and target."""
    rows = []
    for name, runs in data.with_runs.items():
        spent = np.array([run.history["evaluations"][-1] for run in runs])
        for share, hit in zip(TARGET_SHARES, hits(runs, data.steps).T, strict=True):
            cost = expected_running_time_interval(hit, spent, generator())
            reached = hit[~np.isnan(hit)]
            rows.append(
                TargetRow(
                    experiment=name,
                    target=share * data.steps,
                    share=share,
                    fitness=STORED,
                    hits=reached.size,
                    n=hit.size,
                    expected_running_time=cost.value,
                    expected_running_time_low=cost.low,
                    expected_running_time_high=cost.high,
                    median_evaluations=float(np.median(reached))
                    if reached.size
                    else None,
                )
            )
    return rows


def provenance(data: StudyData) -> dict[str, list[Any]]:
    """Commits, versions, processors and arguments of all runs, each once, sorted."""
    found: dict[str, set[Any]] = {key: set() for key in PROVENANCE}
    for runs in data.runs.values():
        for run in runs:
            try:
                fields = RunDirectory(run.path).provenance_fields()
            except UserError:
                continue
            for part in (fields, *fields.get("resumed", ())):
                for key, read in PROVENANCE.items():
                    # what somebody has edited is left out
                    with suppress(AttributeError, KeyError, TypeError):
                        if part.get(key):
                            found[key].add(read(part[key]))
    return {key: sorted(values) for key, values in found.items()}


PROVENANCE = {
    "git": lambda git: git["commit"] + (" and changes" if git["modified"] else ""),
    "versions": lambda versions: ", ".join(f"{k} {v}" for k, v in versions.items()),
    "processor": lambda processor: str(processor.get("model")),
    "argv": lambda argv: shlex.join(argv),
}
"""Parts of a run's provenance that a report gives, and their texts."""
