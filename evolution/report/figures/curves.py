"""Figures of a study against evaluations: how fitness grew, and what it cost."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evolution.pages.style import (
    COLUMN,
    PRINT,
    YARDSTICK_LOOK,
    YARDSTICK_SHORT,
    Look,
    count_evaluations,
    counts,
    legend_below,
    looks,
    width_for,
    with_count,
)
from evolution.pages.words import YARDSTICK_LABEL, label, robot_name
from evolution.report.samples import TARGET_SHARES, hits
from evolution.search.table import searches
from evolution.statistics.targets import ecdf
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun

N_POINTS = 150
"""Most points of a curve: more than print shows, few enough for small files."""

N_MARKERS = 6
"""Markers along a curve, which tell it apart where colour is missing."""

STORED_NOTE = "Stored fitness is the mean of the few trials that evolution ran."

RESTARTS_NOTE = (
    "The population is sometimes replaced by a new one, at different times in each "
    "run, so the mean is not drawn. "
)


def on_grid(
    evaluations: np.ndarray, values: np.ndarray, grid: np.ndarray
) -> np.ndarray:
    """Values `(generations,)` as a step function at `grid`, `(grid,)`.

    Args:
        evaluations: after which each value holds, `(generations,)`, increasing.
        values: the last one holds for ever.
        grid: evaluations, none before the first.
    """
    return values[np.searchsorted(evaluations, grid, side="right") - 1]


def common_grid(runs: Sequence[FinishedRun]) -> np.ndarray:
    """Evaluations where curves of runs are compared, from where all of them began."""
    evaluations = [run.history["evaluations"] for run in runs]
    grid = np.unique(np.concatenate(evaluations))
    grid = grid[grid >= max(each[0] for each in evaluations)]
    thinned = np.linspace(0, grid.size - 1, min(grid.size, N_POINTS))
    return grid[np.round(thinned).astype(int)]


def curves(
    runs: Sequence[FinishedRun], column: str, grid: np.ndarray, so_far: bool = False
) -> np.ndarray:
    """A column of the history of each run at `grid`, or its highest until then."""
    found = []
    for run in runs:
        values = run.history[column]
        values = np.maximum.accumulate(values) if so_far else values
        found.append(on_grid(run.history["evaluations"], values, grid))
    return np.array(found)


@matplotlib.rc_context(PRINT)
def growth_figure(data: StudyData, name: str) -> tuple[Figure, str]:
    """Best so far and population mean of an experiment, as figures 3 to 5 of the paper.

    Populations that begin anew do so in each run at another time, and the median of
    their means is noise: it is left out.

    Raises:
        KeyError: if there is no experiment of that name.
        ValueError: if it has no runs.
    """
    look, runs = looks(data.configs)[name], data.runs[name]
    if not runs:
        raise ValueError(f"expected runs of '{name}', got none")
    grid = common_grid(runs)
    figure = Figure(figsize=(COLUMN, 2.8), layout="constrained")
    axes = figure.add_subplot()
    lines = {}
    best = curves(runs, "best", grid, so_far=True)
    if len(runs) > 1:
        axes.plot(grid, best.T, color=look.color, lw=0.4, alpha=0.35)
    lines["best so far"] = _median_and_band(axes, grid, best, look.color)
    parts = searches(data.configs[name].optimizer)
    anew = len(runs) > 1 and any(getattr(part, "restarts", False) for part in parts)
    if not anew:
        of_mean = _median_and_band(axes, grid, curves(runs, "mean", grid), "0.45")
        of_mean.set(linestyle=(0, (4, 1)), linewidth=0.9)
        lines["population mean"] = of_mean
    of_yardstick = _draw_yardstick(axes, data, lines)
    _stored_axes(axes, data, grid[-1])
    legend_below(figure, lines, title=with_count(data, name, len(runs)))
    caption = (
        f"{label(data, name)}: best stored fitness so far"
        f"{'' if anew else ' and mean of the population'} "
        "against evaluations. Median and interquartile range over runs "
        f"(n = {len(runs)}); thin: the best so far of each run. "
        f"{RESTARTS_NOTE if anew else ''}"
        f"{STORED_NOTE}{of_yardstick}"
    )
    return figure, caption


@matplotlib.rc_context(PRINT)
def growths_figure(data: StudyData) -> tuple[Figure, str]:
    """Best so far of all experiments on one axes."""
    lines, styles, runs, last = {}, looks(data.configs), data.with_runs, 0.0
    figure = Figure(figsize=(width_for(len(runs)), 3.3), layout="constrained")
    axes = figure.add_subplot()
    for i, (name, each) in enumerate(runs.items()):
        grid = common_grid(each)
        best = curves(each, "best", grid, so_far=True)
        line = _median_and_band(axes, grid, best, styles[name].color)
        _mark(line, styles[name], grid.size, i, len(runs))
        lines[with_count(data, name, len(each))] = line
        last = max(last, grid[-1])
    of_yardstick = _draw_yardstick(axes, data, lines)
    _stored_axes(axes, data, last)
    legend_below(figure, lines)
    caption = (
        "Best stored fitness so far against evaluations: median and interquartile "
        f"range over runs ({counts(data)}). {STORED_NOTE}{of_yardstick}"
    )
    return figure, caption


@matplotlib.rc_context(PRINT)
def targets_figure(data: StudyData) -> tuple[Figure, str]:
    """Share of all pairs of run and target reached, against evaluations."""
    lines, styles, runs = {}, looks(data.configs), data.with_runs
    figure = Figure(figsize=(width_for(len(runs)), 3.2), layout="constrained")
    axes = figure.add_subplot()
    last = max(run.history["evaluations"][-1] for each in runs.values() for run in each)
    budgets = np.linspace(0, last, N_POINTS + 1)
    for i, (name, each) in enumerate(runs.items()):
        share = ecdf(hits(each, data.steps), budgets)
        (line,) = axes.plot(
            budgets, share, color=styles[name].color, drawstyle="steps-post"
        )
        _mark(line, styles[name], budgets.size, i, len(runs))
        lines[with_count(data, name, len(each))] = line
    count_evaluations(axes, last)
    axes.set(ylabel="share of (run, target) pairs", ylim=(0, 1.02))
    legend_below(figure, lines)
    fitnesses = ", ".join(f"{share * data.steps:.0f}" for share in TARGET_SHARES)
    caption = (
        "Share of pairs of run and target that were reached within a number of "
        f"evaluations ({counts(data)}). Targets: best stored fitness of {fitnesses} "
        f"of {data.steps}."
    )
    return figure, caption


def _median_and_band(axes: Axes, grid: np.ndarray, values: np.ndarray, color) -> Line2D:
    """The median of `(runs, grid)` as a line, the quartiles as a band behind it."""
    low, median, high = np.quantile(values, [0.25, 0.5, 0.75], axis=0)
    if len(values) > 1:
        axes.fill_between(grid, low, high, color=color, alpha=0.2, lw=0)
    (line,) = axes.plot(grid, median, color=color, lw=1.4)
    return line


def _draw_yardstick(axes: Axes, data: StudyData, lines: dict[str, Line2D]) -> str:
    """The hand-written follower's line, if it was tested, and a caption's words."""
    robot = data.robots[0]
    reference = data.yardstick_mean(robot)
    if reference is None:
        return ""
    lines[YARDSTICK_SHORT] = axes.axhline(reference, **YARDSTICK_LOOK)
    return (
        f" Black and dashed: held-out fitness of the {YARDSTICK_LABEL} on the "
        f"{robot_name(robot)}, which has no stored fitness."
    )


def _mark(line: Line2D, look: Look, size: int, i: int, n: int) -> None:
    """Dashes and markers of an experiment, the `i`th of `n` curves of `size` points."""
    line.set(linestyle=look.dashes, marker=look.marker, markersize=3.5)
    # apart from those of the other curves
    every = max(1, size // N_MARKERS)
    line.set_markevery((round(every * i / n), every))


def _stored_axes(axes: Axes, data: StudyData, last: float) -> None:
    count_evaluations(axes, last)
    axes.set(ylabel=f"stored fitness (max {data.steps})", ylim=(0, data.steps))
