"""The figure of all variations: fitness on wheels, and how likely the paper's order."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evolution.pages.style import PAGE, PRINT, legend_below, looks
from evolution.pages.words import LABELS, PAPERS
from evolution.statistics.significance import LEVELS
from evolution.variations.change_words import in_words
from evolution.variations.varied import UNCHANGED, Order, Varied

ROW = 0.15
"""Height of a row [inch]."""


@matplotlib.rc_context(PRINT)
def variations_figure(varied: Sequence[Varied], found: Sequence[Order]) -> Figure:
    """Figure with a row per change and a panel per algorithm, and one of the orders.

    Fitness is a share of the most, since trials may differ in length.
    """
    rows = list(dict.fromkeys((each.steps, each.change) for each in varied))
    height = 1.3 + ROW * len(rows)
    figure = Figure(figsize=(PAGE, height), layout="constrained")
    panels = figure.subplots(
        1, len(PAPERS) + 1, sharey=True, width_ratios=[1] * len(PAPERS) + [0.6]
    )
    for axes, algorithm in zip(panels, PAPERS, strict=False):
        own = [each for each in varied if each.algorithm == algorithm]
        _draw_algorithm(axes, own, rows, algorithm)
    chances = {order.change: order for order in found}
    axes = panels[-1]
    for row, (_, change) in enumerate(rows):
        order = chances.get(change)
        if order is not None:
            mark = "*" if order.typical else "o"
            axes.plot(order.chance, row, color="black", marker=mark, ms=4, ls="")
    axes.axvline(LEVELS[0], color="0.4", lw=0.8, ls=":")
    axes.set(title="paper's order", xlabel="probability", xlim=(-0.03, 1.03))
    titles = [in_words(change) for _, change in rows]
    panels[0].set_yticks(range(len(rows)), titles, fontsize=6.5)
    panels[0].set_ylim(len(rows) - 0.5, -0.5)
    point = {"color": "black", "ls": "", "ms": 4}
    legend_below(
        figure,
        {
            "median and quartiles": Line2D([], [], marker="o", **point),
            "differs from unchanged": Line2D([], [], marker="D", **point),
            "medians have the paper's order": Line2D([], [], marker="*", **point),
        },
    )
    return figure


def _draw_algorithm(
    axes: Axes, varied: Sequence[Varied], rows: list[tuple[int, str]], algorithm: str
) -> None:
    """Medians and quartiles of one algorithm's variations."""
    color = looks([algorithm])[algorithm].color
    for each in varied:
        row = rows.index((each.steps, each.change))
        low, median, high = np.quantile(each.held_out / each.steps, (0.25, 0.5, 0.75))
        mark = "D" if each.differs else "o"
        axes.plot([low, high], [row, row], color=color, lw=1)
        axes.plot(median, row, color=color, marker=mark, ms=3.5)
        if each.change == UNCHANGED:
            axes.axvline(median, color=color, lw=0.6, ls=":", zorder=0)
    axes.set(title=LABELS[algorithm], xlabel="held-out fitness / most", xlim=(0, 1))
