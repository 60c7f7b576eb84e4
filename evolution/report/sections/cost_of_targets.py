"""Cost of targets: how many evaluations each experiment needs for each fitness."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evolution.pages.blocks import Block, Heading, Paragraph, Table
from evolution.pages.words import SPREAD, evaluations, label, spread
from evolution.report.measures import generator
from evolution.report.samples import BUDGETS, TARGET_SHARES, best_after, hits
from evolution.statistics.estimates import Interval
from evolution.statistics.targets import expected_running_time_interval
from evolution.study.data import StudyData


@dataclass(frozen=True, eq=False)
class TargetCost:
    """Evaluations that an experiment needed for a target.

    Attributes:
        experiment: its name.
        target: stored fitness to reach; a history has no other fitness.
        share: target as a share of the highest fitness there is.
        hits: evaluations until each run reached it, `(runs,)`; nan: never.
        time: expected running time in evaluations, inf if no run reached it.
    """

    experiment: str
    target: float
    share: float
    hits: np.ndarray
    time: Interval

    @property
    def reached(self) -> np.ndarray:
        """Evaluations of the runs that reached it, `(n,)`."""
        return self.hits[~np.isnan(self.hits)]


def target_costs(data: StudyData) -> list[TargetCost]:
    """The cost of each target to each experiment with runs."""
    found = []
    for name, runs in data.with_runs.items():
        spent = np.array([run.history["evaluations"][-1] for run in runs])
        for share, hit in zip(TARGET_SHARES, hits(runs, data.steps).T, strict=True):
            time = expected_running_time_interval(hit, spent, generator())
            found.append(TargetCost(name, share * data.steps, share, hit, time))
    return found


TARGET_COLUMNS: Mapping[str, Callable[[TargetCost], Any]] = {
    "experiment": lambda cost: cost.experiment,
    "target": lambda cost: cost.target,
    "share": lambda cost: cost.share,
    "fitness": lambda cost: "stored",
    "hits": lambda cost: cost.reached.size,
    "n": lambda cost: cost.hits.size,
    "expected_running_time": lambda cost: cost.time.value,
    "expected_running_time_low": lambda cost: cost.time.low,
    "expected_running_time_high": lambda cost: cost.time.high,
    "median_evaluations": lambda cost: (
        float(np.median(cost.reached)) if cost.reached.size else None
    ),
}
"""Columns of targets.csv."""


def target_rows(data: StudyData) -> list[dict[str, Any]]:
    """A row per experiment with runs and target, as `TARGET_COLUMNS` says."""
    return [
        {column: value(cost) for column, value in TARGET_COLUMNS.items()}
        for cost in target_costs(data)
    ]


def cost_of_targets_section(data: StudyData) -> list[Block]:
    """Blocks about the evaluations that each target cost."""
    costs = target_costs(data)
    goals = dict.fromkeys(cost.target for cost in costs)
    found = {(cost.experiment, cost.target): cost for cost in costs}
    return [
        Heading("Cost of targets"),
        Paragraph(
            "Expected running time in individual evaluations if a run that misses the "
            "target is started again; in brackets, how many of the runs reached the "
            "target (none: no run reached it within its budget). Each column is a "
            f"target: a stored fitness, of at most {data.steps}. Histories have no "
            "other fitness, so luck counts here. Intervals are in targets.csv."
        ),
        Table(
            ("experiment", *(f"to {goal:.3g} [evaluations]" for goal in goals)),
            [
                (label(data, name), *(_cost(found[name, goal]) for goal in goals))
                for name in data.with_runs
            ],
        ),
        *_after_budgets(data),
    ]


def _after_budgets(data: StudyData) -> list[Block]:
    """Best stored fitness after fixed numbers of evaluations, if runs have so many."""
    runs = [run for each in data.with_runs.values() for run in each]
    most = max((run.history["evaluations"][-1] for run in runs), default=0)
    budgets = [budget for budget in BUDGETS if budget <= most]
    if not budgets:
        return []
    return [
        Paragraph(f"Best stored fitness after fixed numbers of evaluations. {SPREAD}."),
        Table(
            ("experiment", *(f"after {budget:,}" for budget in budgets)),
            [
                (label(data, name), *(spread(best_after(each, b)) for b in budgets))
                for name, each in data.with_runs.items()
            ],
        ),
    ]


def _cost(cost: TargetCost) -> str:
    time = evaluations(cost.time.value) if cost.reached.size else "none"
    return f"{time} ({cost.reached.size}/{cost.hits.size})"
