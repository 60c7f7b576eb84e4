"""Style of a study's figures, for print: one look per experiment.

Figures have the size they are printed at, so that text keeps its size.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import cycle
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_mj.show import colors
from epuck_mj.show.colors import fraction
from evolution.pages.words import label, robot_name
from evolution.study.data import StudyData

COLUMN, PAGE = 3.5, 7.0
"""Widths of one and of two columns of a paper [inch]."""

PRINT: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 7.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    # letters as shapes look the same on every computer
    "svg.fonttype": "path",
    # equal figures make equal files
    "svg.hashsalt": "epuck-mj",
}
"""Settings of matplotlib with which figures are made and also saved.

Also saved, because matplotlib makes ticks only when it draws.
"""

HANDLE, LETTER = 0.5, 0.054
"""Width of a legend's handle with its gaps, and of a letter beside it [inch]."""

ROW, ROWS = 0.17, 4
"""Height of a row of a legend [inch], and how many rows a figure's height is for."""

FEW = 6
"""Most experiments whose curves fit a figure of one column."""


def width_for(n: int) -> float:
    """Width of a figure with the curves of so many experiments [inch]."""
    return COLUMN if n <= FEW else PAGE


Color = tuple[float, float, float]
Dashes = tuple[float, tuple[float, ...]] | str


@dataclass(frozen=True)
class Look:
    """Colour, line and marker of an experiment in all figures.

    Attributes:
        color: in [0, 1].
        dashes: line style.
        marker: of its points.
    """

    color: Color
    dashes: Dashes
    marker: str


LOOKS: Mapping[str, Look] = {
    "de-best": Look(fraction(colors.BLUE), "-", "o"),
    "de-rand": Look(fraction(colors.VERMILION), (0, (7, 2)), "s"),
    "ga": Look(fraction(colors.GREEN), (0, (7, 1.5, 1.2, 1.5)), "^"),
    "cma-es": Look(fraction(colors.PURPLE), (0, (3, 1.2)), "D"),
    "one-plus-one-es": Look(fraction(colors.ORANGE), (0, (4, 1, 1, 1, 1, 1)), "v"),
    "random-search": Look(fraction(colors.GREY), (0, (1, 1)), ">"),
}
"""Looks of shipped experiments; others take a spare look."""

# without yellow, which can hardly be seen on white paper
SPARE_COLORS = (colors.SKY, colors.ORANGE, colors.PURPLE)
SPARE_LINES = (
    ("-", "P"),
    ((0, (6, 1, 3, 1)), "h"),
    ((0, (2, 2)), "<"),
    ((0, (9, 2)), "*"),
)

YARDSTICK_LOOK: Mapping[str, Any] = {
    "color": "black",
    "linestyle": "--",
    "linewidth": 1,
}
YARDSTICK_SHORT = "hand-written, held-out"


def looks(names: Iterable[str]) -> dict[str, Look]:
    """The look of each experiment, by name."""
    # 12 before the first comes back
    spare = zip(cycle(SPARE_COLORS), cycle(SPARE_LINES), strict=True)
    found = {}
    for name in names:
        if name in LOOKS:
            found[name] = LOOKS[name]
        else:
            rgb, (dashes, marker) = next(spare)
            found[name] = Look(fraction(rgb), dashes, marker)
    return found


def with_count(data: StudyData, name: str, n: int) -> str:
    """An experiment's name for readers with its number of runs."""
    return f"{label(data, name)} (n = {n})"


def counts(data: StudyData) -> str:
    """Text for a caption with the number of runs of each experiment."""
    runs = data.with_runs
    sizes = {len(each) for each in runs.values()}
    if len(sizes) == 1:
        return f"n = {sizes.pop()} per experiment"
    return "; ".join(with_count(data, name, len(each)) for name, each in runs.items())


def count_evaluations(axes: Axes, last: float) -> None:
    """Make the x axis one of evaluations, from 0 to `last`."""
    axes.set(xlabel="individual evaluations", xlim=(0, last))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")


def legend_below(
    figure: Figure, handles: Mapping[str, Artist], title: str | None = None
) -> None:
    """A legend under all axes from handles by label, in as many columns as fit."""
    width = HANDLE + LETTER * max(map(len, handles), default=0)
    columns = min(max(int(figure.get_figwidth() / width), 1), len(handles))
    # the axes keep their height
    rows = math.ceil(len(handles) / max(columns, 1))
    figure.set_figheight(figure.get_figheight() + ROW * max(0, rows - ROWS))
    figure.legend(
        list(handles.values()),
        list(handles),
        title=title,
        loc="outside lower center",
        ncols=columns,
        columnspacing=1.5,
    )


def robot_panels(data: StudyData, rows: list[str]) -> tuple[Figure, list[Axes]]:
    """A figure with a panel per robot and a labelled row per experiment in each."""
    n = len(data.robots)
    size = (max(COLUMN, 1.4 + (PAGE - 1.4) / 2 * n), 1.0 + 0.3 * len(rows))
    figure = Figure(figsize=size, layout="constrained")
    panels = list(figure.subplots(1, n, sharex=True, sharey=True, squeeze=False).flat)
    for axes, robot in zip(panels, data.robots, strict=True):
        axes.set_title(robot_name(robot))
        axes.set_yticks(range(len(rows)), rows)
        # the first on top
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.grid(visible=False, axis="y")
        axes.label_outer()
    for axes in panels[1:]:
        # beside a number in a bar, a tick looks like a minus
        axes.tick_params(axis="y", length=0)
    return figure, panels
