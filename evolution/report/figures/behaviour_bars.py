"""The figure of what champions do: shares of their trials by behaviour class."""

from collections.abc import Mapping
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from epuck_mj.show import colors
from epuck_mj.show.colors import fraction
from evolution.pages.style import PRINT, Color, legend_below, robot_panels, with_count
from evolution.pages.words import YARDSTICK_LABEL
from evolution.report.samples import class_means
from evolution.study.data import StudyData

CLASS_LOOKS: Mapping[str, tuple[Color, str]] = {
    "wall follower": (fraction(colors.BLUE), ""),
    "hugger": (fraction(colors.SKY), "////"),
    "circler": (fraction(colors.GREEN), "----"),
    "bouncer": (fraction(colors.ORANGE), "\\\\\\\\"),
    "searcher": (fraction(colors.YELLOW), ""),
    "spinner": (fraction(colors.PURPLE), "xxxx"),
    "stuck": (fraction(colors.GREY), ""),
    "crashed": (fraction(colors.VERMILION), "||||"),
}
"""Fill and hatch of each class of behaviour; any other is white."""

LEAST_NAMED = 0.08
"""Smallest share whose number has room in its bar."""

HAND_WRITTEN = "hand-written"


@matplotlib.rc_context(PRINT)
def behaviour_figure(data: StudyData) -> tuple[Figure, str] | None:
    """Shares of the behaviour classes; None if no run has them.

    A row per experiment, a panel per robot.
    """
    shares = {robot: _class_shares(data, robot) for robot in data.robots}
    rows = list(dict.fromkeys(row for each in shares.values() for row in each))
    labels = [row for row in rows if row != HAND_WRITTEN]
    if not labels:
        return None
    figure, panels = robot_panels(data, rows)
    for axes, robot in zip(panels, data.robots, strict=True):
        for row, name in enumerate(rows):
            _stack(axes, row, shares[robot].get(name, {}))
        axes.set(xlabel="share of test trials", xlim=(0, 1))
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
        axes.grid(visible=False)
    bars = [bar for each in shares.values() for bar in each.values()]
    classes = dict.fromkeys(name for bar in bars for name in bar)
    seen = [name for name in classes if any(bar.get(name) for bar in bars)]
    legend_below(figure, {name: Patch(**_fill(name)) for name in seen})
    caption = (
        "What the champions do: share of the test trials in each class of behaviour, "
        f"mean over runs ({'; '.join(labels)})."
    )
    if HAND_WRITTEN in rows:
        caption += f" Last row: the {YARDSTICK_LABEL} on the same starts."
    return figure, caption


def _class_shares(data: StudyData, robot: str) -> dict[str, dict[str, float]]:
    """Mean share of each class by row label, over the runs that have them.

    The hand-written wall follower is the last row.
    """
    found = {}
    for name, runs in data.with_runs.items():
        shares = class_means(data, name, robot)
        if shares:
            found[with_count(data, name, len(runs))] = shares
    hand_written = data.yardstick.get(robot)
    if hand_written and hand_written.behaviour:
        found[HAND_WRITTEN] = dict(hand_written.behaviour)
    return found


def _stack(axes: Axes, row: int, shares: dict[str, float]) -> None:
    """One bar of `shares`, in their order, the large ones with their number."""
    left = 0.0
    for name, share in shares.items():
        if not share:
            continue
        axes.barh(row, share, left=left, height=0.7, **_fill(name))
        if share >= LEAST_NAMED:
            axes.text(
                left + share / 2,
                row,
                f"{share:.0%}",
                ha="center",
                va="center",
                fontsize="small",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
            )
        left += share


def _fill(name: str) -> dict[str, Any]:
    """Arguments of the patch of a class of behaviour."""
    fill, hatch = CLASS_LOOKS.get(name, ((1.0, 1.0, 1.0), ""))
    return {"facecolor": fill, "hatch": hatch, "edgecolor": "black", "linewidth": 0.4}
