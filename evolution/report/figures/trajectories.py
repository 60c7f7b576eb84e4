"""The figure of where champions go: trials of the paper's experiments, on wheels."""

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.figure import Figure

from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.show.figures import trajectory_figure
from epuck_mj.trials.recorder import record
from evolution.judging.held_out_starts import starts_for_test
from evolution.pages.style import PAGE, PRINT, with_count
from evolution.pages.words import PAPERS, label
from evolution.settings.config import ExperimentConfig
from evolution.study.data import RunData, StudyData

TRIALS_SHOWN = 2
"""Trials shown of each champion."""

MOST_CHAMPIONS = 3
"""Most champions shown where none of the paper's experiments is there."""


@matplotlib.rc_context(PRINT)
def trajectories_figure(data: StudyData) -> tuple[Figure, str]:
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
        starts = starts_for_test(FreeSpace(scene, config.start_clearance), TRIALS_SHOWN)
        policy = run.champion.controller
        trials.append([record(scene, policy, start, config.task) for start in starts])
        titles.append(
            [
                f"{label(name)}, seed {run.seed}\n"
                f"start {i}: fitness {trial.trial_fitness:.0f}"
                for i, trial in enumerate(trials[-1])
            ]
        )
        who.append(f"seed {run.seed} of {with_count(name, len(runs[name]))}")
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
        f"{TRIALS_SHOWN} test starts; of each experiment the median run by held-out "
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


def _rasterise_paths(figure: Figure) -> None:
    """Hundreds of coloured segments, and the colour bar, make large vector files."""
    for axes in figure.axes:
        for found in axes.collections:
            if isinstance(found, LineCollection | QuadMesh):
                found.set_rasterized(True)
