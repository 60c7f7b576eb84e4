"""The figure of margins: champions on robots that differ in one number."""

from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.margins.changes import CHANGES
from evolution.margins.margins_table import FILE, Margins, read_margins
from evolution.pages.style import (
    FEW,
    PAGE,
    PRINT,
    YARDSTICK_LOOK,
    legend_below,
    looks,
)
from evolution.pages.words import YARDSTICK_LABEL, label
from evolution.study.data import StudyData


def margins_of_study_figure(data: StudyData) -> tuple[Figure, str] | None:
    """Fitness and crash rate against each change; None if that was not measured."""
    margins = read_margins(data.path / FILE)
    if margins is None:
        return None
    names = {name: label(data, name) for name in data.configs}
    names[YARDSTICK] = YARDSTICK_LABEL
    shaded = len(_shown(margins, names)) <= FEW
    caption = (
        "Champions on the kinematic robot when one number of the robot is changed: "
        f"medians over runs{', with the quartiles of fitness shaded' * shaded}. "
        "Dotted: the robot on which they evolved."
    )
    return margins_figure(margins, names, data.steps), caption


def _shown(margins: Margins, names: Mapping[str, str]) -> list[str]:
    """Measured experiments that the study still has."""
    return [name for name in margins.experiments if name in names]


@matplotlib.rc_context(PRINT)
def margins_figure(margins: Margins, names: Mapping[str, str], most: int) -> Figure:
    """Figure with a column per change; medians over runs.

    The quartiles of fitness are shaded unless there are many experiments.

    Args:
        margins: what was measured.
        names: of the experiments, for readers.
        most: the most that a trial can earn.
    """
    experiments = _shown(margins, names)
    styles = looks(name for name in experiments if name != YARDSTICK)
    figure = Figure(figsize=(PAGE, 4.4), layout="constrained")
    grid = figure.subplots(2, len(CHANGES), sharex="col", sharey="row")
    lines: dict[str, Artist] = {}
    for (upper, lower), (change, known) in zip(grid.T, CHANGES.items(), strict=True):
        for name in experiments:
            found = list(margins.of(name, change))
            if not found:
                continue
            amounts = [amount for amount, _, _ in found]
            fitness = np.array([np.quantile(f, (0.25, 0.5, 0.75)) for _, f, _ in found])
            crashes = [np.median(rates) for _, _, rates in found]
            style = _style(styles, name)
            lines[f"{names[name]} (n = {found[0][1].size})"] = upper.plot(
                amounts, fitness[:, 1], **style
            )[0]
            lower.plot(amounts, crashes, **style)
            # with many experiments, shaded areas would hide one another
            if found[0][1].size > 1 and len(experiments) <= FEW:
                shade = {"color": style["color"], "alpha": 0.12, "lw": 0}
                upper.fill_between(amounts, fitness[:, 0], fitness[:, 2], **shade)
        for axes in (upper, lower):
            axes.axvline(known.own, color="0.4", lw=0.8, ls=":")
        lower.set_xlabel(known.title)
        lower.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        upper.set_ylim(0, most)
        lower.set_ylim(-0.02, 1.02)
    grid[0, 0].set_ylabel(f"fitness (max {most})")
    grid[1, 0].set_ylabel("trials that crash")
    for axes in grid[1]:
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    legend_below(figure, lines)
    return figure


def _style(styles: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Arguments of an experiment's line."""
    if name not in styles:
        return dict(YARDSTICK_LOOK)
    look = styles[name]
    return {"color": look.color, "linestyle": look.dashes, "linewidth": 1.4}
