"""Figures of fitness against evaluations and of trajectories.

Figures are made as objects, never through pyplot: nothing global, no window.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import ArrayLike

from epuck_mj.scene.model import Scene
from epuck_mj.scene.outline import shell_outline, wall_outlines
from epuck_mj.show import colors
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.trajectory import Trajectory

BLUE, VERMILION = colors.fraction(colors.BLUE), colors.fraction(colors.VERMILION)

# yellow to dark blue, without the lightest colours, which can hardly be seen on white
FITNESS_COLORS = ListedColormap(colormaps["cividis_r"](np.linspace(0.1, 1, 256)))


START: Mapping[str, Any] = {
    "marker": "o",
    "color": "white",
    "markeredgecolor": "black",
    "markersize": 5,
}
AT_END: Mapping[str, Any] = {
    "marker": "o",
    "color": "none",
    "markeredgecolor": "black",
    "markersize": 7,
    "markeredgewidth": 1.2,
}
CRASH: Mapping[str, Any] = {
    "marker": "x",
    "color": VERMILION,
    "markersize": 8,
    "markeredgewidth": 2,
}


def fitness_figure(
    evaluations: ArrayLike,
    best: ArrayLike,
    mean: ArrayLike,
    title: str,
    steps: int = 300,
    climbed: float | None = None,
) -> Figure:
    """Stored fitness against evaluations, as in figures 3 to 5 of the paper.

    Args:
        evaluations: individuals evaluated so far, `(generations,)`.
        best: highest stored fitness of each generation, `(generations,)`.
        mean: mean stored fitness of each generation, `(generations,)`.
        title: above the axes.
        steps: control steps of a trial, the highest fitness there is.
        climbed: evaluations after which trials were on wheels; None if they never were
            or always.
    """
    figure = Figure(figsize=(6, 3.7), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(evaluations, best, color=BLUE, label="best of the generation")
    axes.plot(evaluations, mean, color=VERMILION, lw=1, label="mean of the population")
    if climbed is not None:
        axes.axvline(climbed, color="0.4", lw=1, ls=":", label="then on wheels")
    axes.set(
        title=title,
        xlabel="individual evaluations",
        ylabel=f"stored fitness (max {steps})",
        ylim=(0, steps),
    )
    axes.set_xlim(left=0)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", lw=0.6)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize="small")
    return figure


def trajectory_figure(
    scene: Scene,
    trajectories: Sequence[Trajectory],
    task: TaskParameters,
    titles: Sequence[str],
    columns: int | None = None,
    walls: bool = True,
) -> Figure:
    """The arena from above with the path of each trajectory, side by side.

    Args:
        scene: where the trajectories were recorded.
        trajectories: one panel each.
        task: what the trials were.
        titles: one per trajectory.
        columns: panels side by side; as many as rows, or one more, if not given.
        walls: whether they are drawn: not if nobody knows where the robot started.

    Raises:
        ValueError: if there is no trajectory, or another number of titles.
    """
    if not trajectories or len(titles) != len(trajectories):
        raise ValueError(
            f"expected one title per trajectory, got {len(titles)} titles and "
            f"{len(trajectories)} trajectories"
        )
    columns = columns or math.ceil(math.sqrt(len(trajectories)))
    rows = -(-len(trajectories) // columns)
    figure = Figure(figsize=(3.2 * columns + 1, 3.4 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    outlines = wall_outlines(scene) if walls else []
    path = LineCollection([])
    for axes, trajectory, title in zip(panels.flat, trajectories, titles, strict=False):
        axes.add_collection(
            PolyCollection(outlines, facecolor="0.45", edgecolor="none")
        )
        path = _draw_trajectory(axes, scene, trajectory)
        axes.set(title=title, aspect="equal", xlabel="x [m]", ylabel="y [m]")
        axes.autoscale_view()
        axes.label_outer()
    used = list(panels.flat[: len(trajectories)])
    for axes in used[-columns:]:
        # none may be below
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("x [m]")
    for axes in panels.flat[len(trajectories) :]:
        axes.remove()
    figure.colorbar(
        path,
        ax=used,
        label=f"step fitness ({task.fitness.rpartition(':')[2]})",
        shrink=0.8,
        aspect=25,
    )
    marks = [
        Line2D([], [], ls="", label="start", **START),
        Line2D([], [], ls="", label="robot at the end", **AT_END),
    ]
    if any(trajectory.crashed for trajectory in trajectories):
        marks.append(Line2D([], [], ls="", label="crash", **CRASH))
    figure.legend(
        handles=marks, loc="outside lower center", ncols=len(marks), frameon=False
    )
    return figure


def _draw_trajectory(
    axes: Axes, scene: Scene, trajectory: Trajectory
) -> LineCollection:
    """Draw path, start and end of a robot; the colours' mapping."""
    points = trajectory.pose[:, :2]
    path = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)),
        array=trajectory.fitness,
        cmap=FITNESS_COLORS,
        norm=Normalize(0, 1),
        linewidths=1.8,
        capstyle="round",
    )
    axes.add_collection(path)
    start, (x, y, yaw) = points[0], trajectory.pose[-1]
    axes.plot(*start, **START)
    forward = np.array([np.cos(yaw), np.sin(yaw)])
    left = np.array([-forward[1], forward[0]])
    shell = shell_outline(scene)
    body = shell @ [forward, left] + (x, y)
    axes.add_patch(Polygon(body, facecolor="none", edgecolor="black", lw=1.2, zorder=3))
    nose = np.array([(x, y), (x, y) + shell[:, 0].max() * forward])
    axes.plot(*nose.T, color="black", lw=1.2)
    if trajectory.crashed:
        axes.plot(x, y, **CRASH)
    return path
