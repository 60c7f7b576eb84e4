"""The figure of where champions go: trials of every experiment, on wheels."""

from textwrap import fill

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.figure import Figure

from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.show.figures import trajectory_figure
from epuck_mj.trials.recorder import record
from evolution.judging.held_out_starts import starts_for_test
from evolution.pages.style import PAGE, PRINT, with_count
from evolution.pages.words import label
from evolution.settings.config import ExperimentConfig
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun

TRIALS_SHOWN = 2
"""Trials shown of each champion."""

TITLE_WIDTH = 22
"""Most letters in a line above a panel."""

MOST_COLUMNS = 2 * TRIALS_SHOWN
"""Panels side by side: the trials of two champions."""


@matplotlib.rc_context(PRINT)
def trajectories_figure(data: StudyData) -> tuple[Figure, str]:
    """Two trials of the median champion of each experiment, on wheels.

    Experiments in another arena than the first, or with another fitness, are left out
    and named in the caption.

    Raises:
        UserError: if the wheeled robot cannot use the arena.
    """
    runs = data.with_runs
    # one picture has one arena and one kind of fitness
    first = data.configs[next(iter(runs))]
    scene = load_scene(data.wheels, first.arena, first.control_step)
    shown = [name for name in runs if _same_world(data.configs[name], first)]
    trials, titles, who = [], [], []
    for name in shown:
        config, run = data.configs[name], median_run(data, name)
        starts = starts_for_test(FreeSpace(scene, config.start_clearance), TRIALS_SHOWN)
        policy = run.champion.controller
        found = [record(scene, policy, start, config.task) for start in starts]
        trials += found
        titles += [
            f"{fill(label(data, name), TITLE_WIDTH)}\n"
            f"seed {run.seed}, start {i}\nfitness {trial.trial_fitness:.0f}"
            for i, trial in enumerate(found)
        ]
        who.append(f"seed {run.seed} of {with_count(data, name, len(runs[name]))}")
    figure = trajectory_figure(
        scene, trials, first.task, titles, min(MOST_COLUMNS, len(trials))
    )
    # letters do not shrink with the panels: room for titles, axis and legend
    rows = -(-len(trials) // MOST_COLUMNS)
    lines = sum(title.count("\n") + 1 for title in titles[::MOST_COLUMNS])
    figure.set_size_inches(PAGE, 1.5 * rows + 0.14 * lines + 0.75)
    *panels, _ = figure.axes
    for axes in panels:
        axes.grid(visible=False)
        axes.locator_params(nbins=3)
    _rasterise_paths(figure)
    caption = (
        "Trajectories of champions on the wheeled robot from the first "
        f"{TRIALS_SHOWN} test starts; of each experiment the median run by held-out "
        f"fitness there: {'; '.join(who)}. Small circle: start; outline: the robot "
        "where it ended; cross: crash."
    )
    others = [label(data, name) for name in runs if name not in shown]
    if others:
        caption += (
            " Not drawn, because arena, control step or fitness differ: "
            f"{', '.join(others)}."
        )
    return figure, caption


def _same_world(a: ExperimentConfig, b: ExperimentConfig) -> bool:
    return (a.arena, a.control_step, a.fitness) == (b.arena, b.control_step, b.fitness)


def median_run(data: StudyData, name: str) -> FinishedRun:
    """The run of median held-out fitness on the wheeled robot, the lower of two."""
    robot = data.wheels if data.wheels in data.robots else data.robots[-1]
    order = np.argsort(data.held_out(name, robot), kind="stable")
    return data.runs[name][order[(order.size - 1) // 2]]


def _rasterise_paths(figure: Figure) -> None:
    """Hundreds of coloured segments, and the colour bar, make large vector files."""
    for axes in figure.axes:
        for found in axes.collections:
            if isinstance(found, LineCollection | QuadMesh):
                found.set_rasterized(True)
