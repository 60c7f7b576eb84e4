"""The table of docs/champions.md: one champion of each experiment, with its tests."""

from collections.abc import Sequence

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.pages.blocks import Table
from evolution.pages.words import label, percent
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun

COLUMNS = (
    "champion",
    "algorithm",
    "of runs",
    "validation",
    "on wheels",
    "crashes [%]",
    "distance from walls [mm]",
    "as evolved",
)


def champions_table(studies: Sequence[StudyData]) -> Table:
    """One champion of each experiment with runs, and its tests on wheels.

    It is the one with the highest fitness on validation starts: a choice by tests would
    make their means too high.
    """
    rows = []
    for study in studies:
        for name, runs in study.with_runs.items():
            best = max(runs, key=lambda run: run.scores.validation)
            address = f"{study.path.name}/{name}/seed-{best.seed}"
            rows.append([address, label(study, name), str(len(runs)), *_scores(best)])
    return Table(COLUMNS, rows, texts=2)


def _scores(run: FinishedRun) -> list[str]:
    """Cells of a champion: fitness, crashes and distance on wheels."""
    test = run.scores.held_out[WHEELED_ROBOT]
    disturbed = run.scores.held_out_as_evolved.get(WHEELED_ROBOT)
    return [
        f"{run.scores.validation:.0f}",
        f"{test.mean:.0f}",
        percent(test.crash_rate),
        f"{1000 * test.clearance:.1f}",
        "" if disturbed is None else f"{disturbed.mean:.0f}",
    ]
