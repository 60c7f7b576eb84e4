"""A picture for print: the arena, a close-up of the robot, and what colours mean."""

from collections.abc import Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

from epuck_mj.scene.model import Scene
from epuck_mj.show.colors import HIGH_FITNESS, LOW_FITNESS, fraction
from epuck_mj.show.rays import FREE_COLOR, NEAR_COLOR
from epuck_mj.show.render import painter
from epuck_mj.trials.trajectory import Trajectory

DPI = 100

ARENA_SHARE, CLOSE_SHARE = 0.66, 0.7
"""Share of the width that the arena has, and of the height the close-up beside it."""

GAP = 0.008
"""White between the two, in widths of the picture."""


def still(
    scene: Scene,
    trajectories: Sequence[Trajectory],
    sensor_range: float,
    size: tuple[int, int],
) -> Figure:
    """The ends of trials in their arena, the first robot close up, and a legend.

    Args:
        scene: where the trajectories were recorded.
        trajectories: what happened, at least one.
        sensor_range: where a ray ends that hits nothing [m].
        size: width and height [pixels], at `DPI`.

    Raises:
        UserError: if no OpenGL is there.
    """
    width, height = size
    left = round(ARENA_SHARE * width)
    right, top = width - left - round(GAP * width), round(CLOSE_SHARE * height)
    with painter(scene, trajectories, left, height) as artist:
        arena = artist.picture()
    with painter(scene, trajectories[:1], right, top) as artist:
        robot = artist.close_up(sensor_range)
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    _show(figure, arena, 0, 0)
    _show(figure, robot, width - right, height - top)
    x, share = 1 - 0.92 * right / width, 0.84 * right / width
    bars = [
        (LOW_FITNESS, HIGH_FITNESS, 1.0, "path: step fitness", 0.2),
        (NEAR_COLOR, FREE_COLOR, 100 * sensor_range, "rays: distance seen [cm]", 0.07),
    ]
    for low, high, most, label, y in bars:
        colors = LinearSegmentedColormap.from_list(
            label, [fraction(low), fraction(high)]
        )
        figure.colorbar(
            ScalarMappable(Normalize(0, most), colors),
            cax=figure.add_axes((x, y, share, 0.025)),
            orientation="horizontal",
            label=label,
            ticks=np.linspace(0, most, 5),
        )
    return figure


def _show(figure: Figure, pixels: np.ndarray, x: int, y: int) -> None:
    """Put pixels with their lower left corner at a place in a figure."""
    size = figure.get_size_inches() * DPI
    place = (*np.array([x, y]) / size, *np.array(pixels.shape[1::-1]) / size)
    axes = figure.add_axes(place)
    axes.imshow(pixels, interpolation="none", aspect="auto")
    axes.set_axis_off()
