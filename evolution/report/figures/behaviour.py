"""Figures of what a study's champions do: where they go, how their trials end."""

from types import MappingProxyType
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.show import colors
from epuck_mj.show.colors import fraction
from epuck_mj.show.figures import trajectory_figure
from epuck_mj.trials.recorder import record
from evolution.judging.starts import starts_for_test
from evolution.pages.style import (
    PAGE,
    PRINT,
    Color,
    counted,
    legend_below,
    robot_panels,
)
from evolution.pages.words import PAPERS, YARDSTICK_LABEL, label
from evolution.report.samples import class_means
from evolution.settings.config import ExperimentConfig
from evolution.study.data import RunData, StudyData

N_STARTS = 2
"""Trials shown of each champion."""

MOST_CHAMPIONS = 3
"""Of which trials are shown, where none of the paper's experiments is there."""

CLASS_LOOKS: MappingProxyType[str, tuple[Color, str]] = MappingProxyType(
    {
        "wall follower": (fraction(colors.BLUE), ""),
        "hugger": (fraction(colors.SKY), "////"),
        "circler": (fraction(colors.GREEN), "----"),
        "bouncer": (fraction(colors.ORANGE), "\\\\\\\\"),
        "searcher": (fraction(colors.YELLOW), ""),
        "spinner": (fraction(colors.PURPLE), "xxxx"),
        "stuck": (fraction(colors.GREY), ""),
        "crashed": (fraction(colors.VERMILION), "||||"),
    }
)
"""Fill and hatch of each class of behaviour; any other is white."""

LEAST_NAMED = 0.08
"""Smallest share whose number has room in its bar."""

HAND_WRITTEN = "hand-written"


@matplotlib.rc_context(PRINT)
def trajectories(data: StudyData) -> tuple[Figure, str]:
    """Two trials of the median champion of the paper's experiments, on wheels.

    Any other experiments stand in if none of the paper's has runs. Those in another
    arena than the first, or with another fitness, are left out.

    Raises:
        UserError: if the wheeled robot cannot use the arena.
    """
    runs = data.with_runs
    shown = [name for name in PAPERS if name in runs] or list(runs)[:MOST_CHAMPIONS]
    # one picture has one arena and one kind of fitness
    config = data.configs[shown[0]]
    scene = load_scene(WHEELED_ROBOT, config.arena, config.control_step)
    shown = [name for name in shown if _same_world(data.configs[name], config)]
    trials, titles, who = [], [], []
    for name in shown:
        config, run = data.configs[name], median_run(data, name)
        starts = starts_for_test(FreeSpace(scene, config.start_clearance), N_STARTS)
        policy = run.champion.controller
        trials.append([record(scene, policy, start, config.task) for start in starts])
        titles.append(
            [
                f"{label(name)}, seed {run.seed}\n"
                f"start {i}: fitness {trial.trial_fitness:.0f}"
                for i, trial in enumerate(trials[-1])
            ]
        )
        who.append(f"seed {run.seed} of {counted(name, len(runs[name]))}")
    # a column each
    figure = trajectory_figure(
        scene,
        [trial for start in zip(*trials, strict=True) for trial in start],
        config.task,
        [title for start in zip(*titles, strict=True) for title in start],
    )
    width, height = figure.get_size_inches()
    # letters do not shrink with the panels: room for the titles
    figure.set_size_inches(PAGE, height * PAGE / width + 0.4)
    for axes in figure.axes:
        axes.grid(visible=False)
        axes.locator_params(nbins=5)
    _rasterise_paths(figure)
    caption = (
        "Trajectories of champions on the wheeled robot from the first "
        f"{N_STARTS} test starts; of each experiment the median run by held-out "
        f"fitness there: {'; '.join(who)}. Circle: start; outline: where the robot "
        "ended; cross: crash."
    )
    return figure, caption


def _same_world(a: ExperimentConfig, b: ExperimentConfig) -> bool:
    return (a.arena, a.control_step, a.fitness) == (b.arena, b.control_step, b.fitness)


def median_run(data: StudyData, name: str) -> RunData:
    """The run of median held-out fitness on the wheeled robot, the lower of two."""
    robot = WHEELED_ROBOT if WHEELED_ROBOT in data.robots else data.robots[-1]
    order = np.argsort(data.held_out(name, robot), kind="stable")
    return data.runs[name][order[(order.size - 1) // 2]]


@matplotlib.rc_context(PRINT)
def behaviour(data: StudyData) -> tuple[Figure, str] | None:
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
            found[counted(name, len(runs))] = shares
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


def _rasterise_paths(figure: Figure) -> None:
    """Hundreds of coloured segments, and the colour bar, make large vector files."""
    for axes in figure.axes:
        for found in axes.collections:
            if isinstance(found, LineCollection | QuadMesh):
                found.set_rasterized(True)
