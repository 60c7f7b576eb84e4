"""Figure of the gap: fitness and crashes of experiments in worlds of each kind."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from epuck_mj.show import colors
from epuck_mj.show.colors import fraction
from evolution.gap.transfer import Gap
from evolution.gap.worlds import KINDS
from evolution.pages.style import PAGE, PRINT, legend_below
from evolution.pages.words import robot_name

MARKS = {
    "usual": ("o", colors.BLUE),
    "beyond": ("s", colors.VERMILION),
    "corners": ("^", colors.GREEN),
    "calibrated-gains": ("D", colors.PURPLE),
}
"""Marker and colour of each kind of worlds."""

APART = 0.22
"""Distance of two kinds in the row of an experiment, in rows."""


def gap_figure(gaps: Sequence[Gap], names: Mapping[str, str]) -> Figure:
    """Figure with a row per experiment, and two panels per robot: fitness, crashes.

    Args:
        gaps: of the same policies, in worlds of each kind.
        names: of their groups, for readers.
    """
    first = gaps[0]
    rows = [f"{names[group]} ({len(of)})" for group, of in first.groups.items()]
    with matplotlib.rc_context(PRINT):
        n = len(first.transfers)
        height = n * (0.6 + 0.24 * len(rows)) + 0.3
        figure = Figure(figsize=(PAGE, height), layout="constrained")
        panels = figure.subplots(n, 2, sharey=True, sharex="col", squeeze=False)
        lines: dict[str, Artist] = {}
        for k, robot in enumerate(first.transfers):
            for axes, what, title in (
                (panels[k, 0], "fitness", "fitness a step"),
                (panels[k, 1], "crash_rate", "trials that crash"),
            ):
                for i, gap in enumerate(gaps):
                    values = getattr(gap.transfers[robot], what).mean(axis=0)
                    own = [values[of] for of in gap.groups.values()]
                    y = np.arange(len(rows)) + APART * (i - (len(gaps) - 1) / 2)
                    marker, color = MARKS[gap.kind]
                    low, high = ([f(each) for each in own] for f in (np.min, np.max))
                    axes.hlines(y, low, high, color=fraction(color), lw=0.8)
                    (line,) = axes.plot(
                        [np.median(each) for each in own],
                        y,
                        linestyle="",
                        marker=marker,
                        ms=3.5,
                        color=fraction(color),
                    )
                    lines[KINDS[gap.kind].title] = line
                axes.set(title=robot_name(robot), xlabel=title, xlim=(0, None))
        panels[0, 1].xaxis.set_major_formatter(PercentFormatter(1.0))
        panels[0, 0].set_yticks(range(len(rows)), rows)
        # the first on top
        panels[0, 0].set_ylim(len(rows) - 0.5, -0.5)
        legend_below(figure, lines)
    return figure
