"""A picture of an arena from above: its walls, and where robots may start."""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from epuck_mj.scene.geometry import seen_by_rays
from epuck_mj.scene.model import Scene
from epuck_mj.scene.outline import geom_outlines, shell_outline, wall_outlines
from epuck_mj.scene.robot_parts import SHELL, can_touch, of_robot, static
from epuck_mj.scene.starts import Grid
from epuck_mj.show.colors import GREEN, ORANGE, fraction

WALL = "0.45"


def region_figure(scene: Scene, grid: Grid, title: str) -> Figure:
    """Figure of walls and the free region, or of the leak if no region is enclosed.

    Args:
        scene: robot and arena.
        grid: where the robot fits.
        title: above the axes.
    """
    enclosed = bool(grid.inside.any())
    region = grid.inside if enclosed else grid.free
    color, meaning = (
        (GREEN, "may start") if enclosed else (ORANGE, "fits, not enclosed")
    )
    # half a node beyond the first and the last
    low = grid.origin - grid.spacing / 2
    high = low + grid.spacing * np.array(region.shape)
    figure = Figure(figsize=(6, 6), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(
        np.where(region, 1.0, np.nan).T,
        cmap=ListedColormap([fraction(color)]),
        alpha=0.5,
        origin="lower",
        extent=(low[0], high[0], low[1], high[1]),
        interpolation="nearest",
    )
    axes.add_collection(
        PolyCollection(wall_outlines(scene), facecolor=WALL, edgecolor=WALL)
    )
    moving = geom_outlines(scene, _moving(scene))
    axes.add_collection(
        PolyCollection(moving, facecolor="none", edgecolor=WALL, linestyle="--")
    )
    shell = shell_outline(scene)
    legend: list[Patch | Line2D] = [
        Patch(facecolor=fraction(color), alpha=0.5, label=f"robot's middle {meaning}"),
        Patch(facecolor=WALL, label="walls"),
    ]
    if moving:
        things = Patch(fc="none", ec=WALL, ls="--", label="moves: no wall")
        legend.append(things)
    if enclosed:
        # on the node farthest along the diagonal
        shell = shell + grid.nodes[grid.inside][-1]
        axes.fill(*shell.T, facecolor="none", edgecolor="black")
        outline = {"mfc": "none", "mec": "black", "ms": 9}
        size = Line2D([], [], ls="", marker="o", label="robot's size", **outline)
        legend.append(size)
    # four in a line are wider than the figure
    columns = 2 if len(legend) > 3 else len(legend)
    figure.legend(
        handles=legend, loc="outside lower center", ncols=columns, frameon=False
    )
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    return figure


def _moving(scene: Scene) -> np.ndarray:
    """Which geoms of the arena move and can be hit or seen, `(ngeom,)`."""
    model = scene.model
    meets = can_touch(model, model.geom(SHELL).id) | seen_by_rays(model)
    return meets & ~static(model) & ~of_robot(model)
