"""Cost of targets: how many evaluations each experiment needs for each fitness."""

from dataclasses import dataclass

import numpy as np

from evolution.pages.blocks import Block, Heading, Paragraph, Table
from evolution.pages.words import evaluations, label
from evolution.report.measures import generator
from evolution.report.samples import TARGET_SHARES, hits
from evolution.statistics.targets import expected_running_time_interval
from evolution.study.data import StudyData


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
                    fitness="stored",
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


def cost_of_targets_section(data: StudyData) -> list[Block]:
    """What each target cost."""
    rows = target_rows(data)
    goals = dict.fromkeys(row.target for row in rows)
    found = {(row.experiment, row.target): row for row in rows}
    return [
        Heading("Cost of targets"),
        Paragraph(
            "Expected running time in individual evaluations, if whoever fails starts "
            "again, and the runs that reached the target (none: not within any run's "
            "budget). Targets are of stored "
            "fitness, the only one that a history has, so luck counts here. Intervals "
            "are in targets.csv."
        ),
        Table(
            ("experiment", *(f"{goal:g}" for goal in goals)),
            [
                (label(name), *(_cost(found[name, goal]) for goal in goals))
                for name in data.with_runs
            ],
        ),
    ]


def _cost(row: TargetRow) -> str:
    if not row.hits:
        return f"none ({row.hits}/{row.n})"
    return f"{evaluations(row.expected_running_time)} ({row.hits}/{row.n})"
