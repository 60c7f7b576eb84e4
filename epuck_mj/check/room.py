"""Findings about where a robot may start."""

import math

import numpy as np
from scipy import ndimage

from epuck_mj.check.findings import Finding, Place, error, info, names, warning
from epuck_mj.check.heights import extent, mm
from epuck_mj.check.source import Places
from epuck_mj.errors import UserError
from epuck_mj.scene.clearance import CLEARANCE_MAX, ClearanceProbe
from epuck_mj.scene.model import Scene
from epuck_mj.scene.outline import shell_outline
from epuck_mj.scene.starts import FreeSpace, Grid, enclosed, in_the_way
from epuck_mj.step.control import START_CLEARANCE

TOPIC = "room"
SAMPLE = 64
"""Number of starts drawn to test whether starts can be drawn."""

LEAK_TOLERANCE = 0.01
"""Share of the grid by which equal leaks may differ between two clearances."""


def room_findings(scene: Scene, grid: Grid, places: Places) -> list[Finding]:
    """The free region: its size and its parts, or why there is none."""
    place = Place(scene.arena)
    if not grid.inside.any():
        blocker = in_the_way(scene, grid)
        if blocker is not None:
            geom, share = blocker
            low, high = extent(scene.model, geom)
            text = f"no room for a start: it is in the way at {share:.0%} of all "
            text += f"places, from {mm(low)} to {mm(high)} above 0"
            return [error(TOPIC, text, places.geom(geom))]
        return [error(TOPIC, _why_none(scene, grid), place)]
    node = grid.spacing**2
    floor = math.prod(grid.upper - grid.lower)
    area = grid.inside.sum() * node
    findings = [
        info(
            TOPIC,
            f"robots may start on {area:.3f} m^2 (where their middle may be), "
            f"{area / floor:.0%} of the {floor:.3f} m^2 of the box around the walls",
        ),
        info(TOPIC, f"they keep {1000 * START_CLEARANCE:.0f} mm from walls"),
    ]
    parts = _parts(grid.inside)
    sizes = [f"{part.sum() * node:.3f}" for part in parts]
    if len(parts) > 1:
        text = f"{len(parts)} separate regions of {names(sizes)} m^2: a robot may "
        findings.append(warning(TOPIC, text + "never leave the one it is in", place))
    else:
        findings.append(info(TOPIC, "1 region: all of it can be reached"))
    try:
        FreeSpace(scene, START_CLEARANCE).sample(np.random.default_rng(0), SAMPLE)
    except UserError as problem:
        findings.append(error(TOPIC, str(problem), place))
    return findings


def _why_none(scene: Scene, grid: Grid) -> str:
    """Text on why no free node is enclosed: a gap in the walls, or no room."""
    try:
        poses = np.zeros((*grid.free.shape, 3))
        poses[..., :2] = grid.nodes
        distance = ClearanceProbe(scene, 1).measure(poses).distance
    except UserError as problem:
        return str(problem)
    gap = _gap(grid, distance)
    width = float(np.ptp(shell_outline(scene)[:, 1]))
    if gap is not None:
        clearance, (x, y) = gap
        return (
            f"the walls enclose nothing: there is a way out about "
            f"{width + 2 * clearance:.2f} m wide near x {x:.2f} m, y {y:.2f} m"
        )
    # a thinner robot would find an inside, or this one without its clearance
    if any(enclosed(distance >= less).any() for less in (0, -0.45 * width)):
        return (
            "no room for a start: between the walls the robot cannot keep "
            f"{1000 * START_CLEARANCE:.0f} mm from all of them"
        )
    return (
        "the walls enclose nothing: expected walls all around the robot, with no gap "
        "as wide as it (see --picture)"
    )


def _gap(grid: Grid, distance: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Largest clearance of a way out through the walls, and its place `(2,)`.

    The more clearance a robot keeps, the fewer gaps it fits through. The one to the
    outside is shut at the least clearance with which the outside gets no farther in.
    """
    if enclosed(distance > 0).any():
        # what is inside without any clearance has shrunk to nothing, and has no gap
        return None
    step = grid.spacing / 2
    closing = [
        (_leak(grid, distance, level), level)
        for level in np.arange(step, CLEARANCE_MAX, step).tolist()
        if (enclosed(distance > level) & ~enclosed(distance > level - step)).any()
    ]
    if not closing:
        return None
    least = min(leak for leak, _ in closing) + LEAK_TOLERANCE * distance.size
    level = next(level for leak, level in closing if leak <= least)
    free = distance > level
    inside = enclosed(free)
    outside = free & ~inside
    # the nodes that touch both sides, one level earlier
    door = distance > level - step
    door &= ~free
    everywhere = np.ones((3, 3))
    near = ndimage.binary_dilation(inside, everywhere, iterations=2)
    near_outside = ndimage.binary_dilation(outside, everywhere, iterations=2)
    for part in _parts(door):
        if (part & near).any() and (part & near_outside).any():
            ends = np.logical_or(near, near_outside)
            return level, grid.nodes[part & ends].mean(axis=0)
    return None


def _leak(grid: Grid, distance: np.ndarray, level: float) -> int:
    """Number of nodes of the box around the walls that can be reached from outside.

    With the clearance `level`; the robot's whole disc counts.
    """
    free = distance > level
    outside = free & ~enclosed(free)
    away = np.asarray(ndimage.distance_transform_edt(~outside, grid.spacing))
    box = (grid.nodes > grid.lower) & (grid.nodes < grid.upper)
    return int(((away <= level) & (distance >= 0) & box.all(axis=-1)).sum())


def _parts(nodes: np.ndarray) -> list[np.ndarray]:
    """The connected parts of a mask `(x, y)`, one mask each."""
    labels = np.empty(nodes.shape, np.int32)
    ndimage.label(nodes, output=labels)
    return [labels == label for label in range(1, int(labels.max()) + 1)]
