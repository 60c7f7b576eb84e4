"""Figures of a study's champions: what luck gave them, and what fresh starts say."""

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evolution.pages.style import (
    COLUMN,
    PAGE,
    PRINT,
    YARDSTICK_LOOK,
    YARDSTICK_SHORT,
    Look,
    counts,
    legend_below,
    looks,
    robot_panels,
    with_count,
)
from evolution.pages.words import YARDSTICK_LABEL, robot_name
from evolution.report.samples import with_noise
from evolution.statistics.estimates import quartiles
from evolution.study.data import StudyData

MOST_COLUMNS = 3
"""Panels side by side."""

LUCK_AREA = 32
"""Area of a mark beside its stored fitness [square points]."""

DOT_SPREAD = 0.28
"""Farthest that a run's dot lies from its row, in rows."""

CHAMPION = "A champion's held-out fitness is its mean on the test starts."


@matplotlib.rc_context(PRINT)
def stored_and_held_out_figure(data: StudyData) -> tuple[Figure, str]:
    """Held-out against stored fitness of every champion, a panel per experiment."""
    runs, styles = data.with_runs, looks(data.configs)
    columns = min(len(runs), MOST_COLUMNS)
    rows = -(-len(runs) // columns)
    width = max(COLUMN, PAGE * columns / MOST_COLUMNS)
    figure = Figure(figsize=(width, 0.4 + 2.3 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
    reference = data.yardstick_mean(data.robots[0])
    for axes in grid.flat[len(runs) :]:
        axes.remove()
    for axes, (name, each) in zip(grid.flat, runs.items(), strict=False):
        _draw_luck(axes, data, name, styles[name])
        if reference is not None:
            axes.axhline(reference, **YARDSTICK_LOOK, zorder=1)
        axes.set_title(with_count(data, name, len(each)))
        axes.set(ylim=(0, data.steps), xlabel="runs, in order of stored fitness")
    for axes in grid[:, 0]:
        axes.set_ylabel(f"fitness (max {data.steps})")
    dot = {"color": "0.3", "ls": "", "marker": "o", "ms": 5}
    lines = {"stored": Line2D([], [], color="black", ls="", marker="_", ms=8, mew=1.6)}
    for robot in data.robots:
        fill = "0.3" if robot == data.robots[0] else "white"
        lines[f"held-out, {robot_name(robot)}"] = Line2D([], [], mfc=fill, **dot)
    if reference is not None:
        lines[YARDSTICK_SHORT] = Line2D([], [], **YARDSTICK_LOOK)
    legend_below(figure, lines)
    caption = (
        f"Stored and held-out fitness of each champion ({counts(data)}). The black "
        "bar is the stored fitness. The vertical distance from the bar down to the "
        f"filled mark, of the {robot_name(data.robots[0])}, is luck. "
        f"{CHAMPION}"
    )
    if any(with_noise(data, name) for name in runs):
        caption += (
            " In experiments that evolved with noise, the distance is more than luck: "
            "the dots are for ideal robots."
        )
    if reference is not None:
        caption += (
            f" Dashed: the {YARDSTICK_LABEL} on the {robot_name(data.robots[0])}."
        )
    return figure, caption


@matplotlib.rc_context(PRINT)
def held_out_figure(data: StudyData) -> tuple[Figure, str]:
    """Held-out fitness of every champion, a row per experiment, a panel per robot."""
    runs, styles = data.with_runs, looks(data.configs)
    labels = [with_count(data, name, len(each)) for name, each in runs.items()]
    figure, panels = robot_panels(data, labels)
    lines = {
        "one run": Line2D([], [], color="0.4", ls="", marker="o", ms=3.5),
        "median and IQR": Line2D([], [], color="black", lw=0.8, marker="|", mew=2),
    }
    for axes, robot in zip(panels, data.robots, strict=True):
        for row, name in enumerate(runs):
            _draw_row(axes, row, data.held_out(name, robot), styles[name])
        reference = data.yardstick_mean(robot)
        if reference is not None:
            lines[YARDSTICK_LABEL] = axes.axvline(reference, **YARDSTICK_LOOK, zorder=1)
        axes.set(xlabel=f"held-out fitness (max {data.steps})", xlim=(0, data.steps))
    legend_below(figure, lines)
    caption = (
        f"Held-out fitness of the champions ({counts(data)}): every run, the median "
        f"(tick) and the interquartile range (bar). {CHAMPION}"
    )
    if YARDSTICK_LABEL in lines:
        caption += f" Dashed: the {YARDSTICK_LABEL} on the same starts and robot."
    return figure, caption


@matplotlib.rc_context(PRINT)
def rungs_figure(data: StudyData) -> tuple[Figure, str] | None:
    """Held-out fitness on one robot against the other; None if there is one."""
    if data.rungs is None:
        return None
    first, last = data.rungs
    runs, styles = data.with_runs, looks(data.configs)
    figure = Figure(figsize=(COLUMN, 4), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, data.steps], [0, data.steps], color="0.5", lw=0.8, zorder=1)
    lines = {}
    for name, each in runs.items():
        x, y = data.held_out(name, first), data.held_out(name, last)
        axes.scatter(x, y, **_dots(styles[name]))
        lines[with_count(data, name, len(each))] = Line2D(
            [], [], color=styles[name].color, ls="", marker=styles[name].marker, ms=4
        )
    x, y = data.yardstick_mean(first), data.yardstick_mean(last)
    if x is not None and y is not None:
        axes.plot(x, y, "+", color="black", ms=9, mew=1, zorder=4)
        lines[YARDSTICK_LABEL] = Line2D([], [], color="black", ls="", marker="+", ms=7)
    axes.set(
        xlim=(0, data.steps),
        ylim=(0, data.steps),
        aspect="equal",
        xlabel=f"held-out fitness, {robot_name(first)} (max {data.steps})",
        ylabel=f"held-out fitness, {robot_name(last)} (max {data.steps})",
    )
    # the same number of ticks on both axes
    axes.locator_params(nbins=4)
    legend_below(figure, lines)
    caption = (
        f"Held-out fitness of the champions on the {robot_name(last)} against that on "
        f"the {robot_name(first)} ({counts(data)}). On the diagonal, fitness is the "
        "same on both robots."
    )
    return figure, caption


def _draw_luck(axes: Axes, data: StudyData, name: str, look: Look) -> None:
    """Stored and held-out fitness of an experiment's runs, by rising stored fitness."""
    stored = data.stored(name)
    order = np.argsort(stored, kind="stable")
    rank, stored = np.arange(order.size), stored[order]
    tests = np.array([data.held_out(name, robot)[order] for robot in data.robots])
    # held-out fitness may also be the higher one
    everything = np.vstack([tests, stored])
    low, high = everything.min(axis=0), everything.max(axis=0)
    axes.vlines(rank, low, high, color=look.color, lw=0.9, zorder=2)
    axes.scatter(rank, stored, marker="_", s=40, color="black", lw=1.6, zorder=4)
    # the robot that is reported is filled, and in front
    for i, test in reversed(list(enumerate(tests))):
        axes.scatter(rank, test, **_dots(look, filled=i == 0, area=LUCK_AREA))
    axes.set(xticks=[], xlim=(-1, order.size))


def _dots(look: Look, filled: bool = True, area: float = 18) -> dict[str, Any]:
    """Arguments of a scatter plot of an experiment's runs."""
    return {
        "marker": look.marker,
        "s": area,
        "facecolor": look.color if filled else "white",
        "edgecolor": "white" if filled else look.color,
        "linewidths": 0.4 if filled else 0.9,
        "zorder": 3,
        # whole even at 0
        "clip_on": False,
    }


def _draw_row(axes: Axes, row: int, sample: np.ndarray, look: Look) -> None:
    """Values `(runs,)` as dots around a row; of two and more, median and quartiles."""
    # multiples of the golden ratio never pile up
    offset = DOT_SPREAD * (2 * ((np.arange(sample.size) * 0.618034 + 0.5) % 1) - 1)
    axes.scatter(sample, row + offset, **_dots(look))
    if sample.size == 1:
        return
    found = quartiles(sample)
    axes.plot([found.lower, found.upper], [row, row], color="black", lw=0.8, zorder=4)
    axes.plot(found.median, row, "|", color="black", ms=11, mew=1.6, zorder=4)
