"""Figures about evolution that learns: what it is worth, and how much learning."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.hybrids.compared import (
    BASE,
    crash_rates,
    median_with_never,
    sweep,
    trials_to_useful,
)
from evolution.pages.style import COLUMN, PAGE, PRINT, looks
from evolution.pages.words import label
from evolution.study.data import StudyData

ROW = 0.17
"""Height of a row [inch]."""


@matplotlib.rc_context(PRINT)
def worth_figure(data: StudyData) -> Figure:
    """Every run of every experiment: fitness, crashes and trials to a useful robot."""
    names = list(data.with_runs)
    figure = Figure(figsize=(PAGE, 0.9 + ROW * len(names)), layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    measured = {
        "held-out fitness, epuck": lambda name: data.held_out(name, WHEELED_ROBOT),
        "crashed test trials, epuck [%]": lambda name: 100 * crash_rates(data, name),
        "thousand trials to 200 stored": lambda name: (
            trials_to_useful(data, name) / 1000
        ),
    }
    style = looks([BASE])[BASE]
    for axes, (title, values) in zip(panels, measured.items(), strict=True):
        for row, name in enumerate(names):
            each = values(name)
            known, middle = each[np.isfinite(each)], median_with_never(each)
            color = style.color if name == BASE else "0.35"
            axes.plot(known, np.full(known.size, row), ".", color=color, ms=3)
            if np.isfinite(middle):
                axes.plot(middle, row, "|", color="black", ms=8, mew=1.5)
        axes.set(xlabel=title)
        axes.grid(axis="x", color="0.9")
    panels[0].set(xlim=(0, data.steps))
    panels[0].axvline(
        np.median(data.held_out(BASE, WHEELED_ROBOT)), color=style.color, lw=0.6, ls=":"
    )
    panels[1].set(xlim=(-3, 103))
    panels[2].set(xlim=(0, data.configs[BASE].budget / 1000))
    panels[0].set_yticks(
        range(len(names)), [label(data, name) for name in names], fontsize=7
    )
    panels[0].set_ylim(len(names) - 0.5, -0.5)
    return figure


@matplotlib.rc_context(PRINT)
def sweep_figure(data: StudyData) -> Figure:
    """Fitness on wheels against the share of the budget that lessons cost."""
    figure = Figure(figsize=(COLUMN, 2.6), layout="constrained")
    axes = figure.subplots()
    found = sweep(data)
    for (rule, by_share), look in zip(
        found.items(), looks(["ga", "de-rand", "cma-es"]).values(), strict=False
    ):
        shares = 100 * np.array(list(by_share))
        low, median, high = np.array(
            [np.quantile(each, (0.25, 0.5, 0.75)) for each in by_share.values()]
        ).T
        axes.fill_between(shares, low, high, color=look.color, alpha=0.15, lw=0)
        axes.plot(
            shares,
            median,
            color=look.color,
            ls=look.dashes,
            marker=look.marker,
            ms=4,
            label=rule.replace("_", " "),
        )
    axes.set(
        xlabel="share of the trials that lessons cost [%]",
        ylabel="held-out fitness, epuck",
        ylim=(0, data.steps),
    )
    axes.grid(color="0.9")
    axes.legend()
    return figure
