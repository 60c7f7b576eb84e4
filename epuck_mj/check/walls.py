"""Findings about the geoms of an arena."""

from collections import Counter

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from epuck_mj.check.findings import Finding, Place, error, info, names, warning
from epuck_mj.check.heights import Heights, extent, extents, mm
from epuck_mj.check.source import Places
from epuck_mj.scene.boxes import at_rest
from epuck_mj.scene.clearance import MEASURED
from epuck_mj.scene.floor import floors
from epuck_mj.scene.geometry import box_around_walls, mesh, seen_by_rays, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.outline import geom_outlines, within
from epuck_mj.scene.robot_parts import SHELL, can_touch, of_robot, static
from epuck_mj.scene.starts import Grid
from epuck_mj.step.control import START_CLEARANCE

TOPIC = "walls"

FAR = 1e4
"""Distance beyond any wall [m]."""

CONCAVE = 0.01
"""Share of a hull's volume that its mesh may leave empty and still count as convex."""

_SHAPE = mujoco.mjtGeom


def finite_findings(model: mujoco.MjModel, places: Places) -> list[Finding]:
    """Errors for geoms so far away that nothing can be measured with them."""
    data = at_rest(model)
    values = np.concatenate([data.geom_xpos, data.geom_xmat, model.geom_size], axis=1)
    nowhere = ~(np.abs(values) < FAR).all(axis=1)
    return [
        error(TOPIC, f"expected finite numbers below {FAR:g} m", places.geom(geom))
        for geom in np.flatnonzero(nowhere).tolist()
    ]


def shape_findings(model: mujoco.MjModel, places: Places) -> list[Finding]:
    """Errors for walls whose distance cannot be measured."""
    return [
        error(
            TOPIC,
            f"a wall cannot be of type {_kind(model, geom)}: clearance to it has no "
            "measure; expected box, plane, cylinder, capsule, ellipsoid, sphere, mesh",
            places.geom(geom),
        )
        for geom in np.flatnonzero(walls(model)).tolist()
        if _SHAPE(model.geom_type[geom]) not in MEASURED
    ]


def floor_findings(scene: Scene, places: Places) -> list[Finding]:
    """Information about the floor, if it is not at 0 or its bits are a wall's."""
    there = np.flatnonzero(floors(scene.model, scene.height)).tolist()
    shown = names([places.geom(geom).element or "<geom>" for geom in there])
    findings = []
    if scene.height:
        height = f"{mm(scene.height)}: on {shown}"
        findings.append(info("floor", f"robots stand at height {height}"))
    if scene.floor:
        shown = names([places.geom(geom).element or "<geom>" for geom in scene.floor])
        text = f"taken as the floor, since level at height {mm(scene.height)}: {shown}"
        findings.append(info("floor", text))
    return findings


def wall_findings(
    scene: Scene, grid: Grid, places: Places, heights: Heights
) -> list[Finding]:
    """Findings about the geoms of an arena."""
    model = scene.model
    findings = _found(model)
    low, high = extents(model).T
    hidden = walls(model) & ((high <= heights.shell[0]) | (low >= heights.shell[1]))
    for geom in np.flatnonzero(walls(model)).tolist():
        place = places.geom(geom)
        if hidden[geom]:
            findings += _hidden(scene, grid, geom, place, heights)
        else:
            findings += _mesh(model, geom, place)
    return findings


def moving_findings(model: mujoco.MjModel, places: Places) -> list[Finding]:
    """Warnings of things that move and that the shell can hit or rays can see."""
    moves = ~static(model) & ~of_robot(model)
    hit, seen = can_touch(model, model.geom(SHELL).id), seen_by_rays(model)
    tree = model.body_rootid[model.geom_bodyid]
    findings = []
    for body in np.unique(tree[moves & (hit | seen)]).tolist():
        its = moves & (tree == body)
        does = [
            *(["touching it is a crash"] if (its & hit).any() else []),
            *(["rays see it"] if (its & seen).any() else []),
        ]
        text = f"it moves, so it is no wall: {' and '.join(does)}, but clearances and "
        text += "figures of runs leave it out"
        findings.append(warning(TOPIC, text, places.body(body)))
    return findings


def untouched_findings(
    model: mujoco.MjModel, places: Places, heights: Heights
) -> list[Finding]:
    """Warnings of what stands where a shell is, but cannot be hit by it."""
    others = static(model) & ~of_robot(model) & ~walls(model)
    others &= model.geom_type != _SHAPE.mjGEOM_PLANE
    low, high = extents(model).T
    others &= (high > heights.shell[0]) & (low < heights.shell[1])
    return [
        warning(TOPIC, no_wall(model, geom), places.geom(geom))
        for geom in np.flatnonzero(others & seen_by_rays(model)).tolist()
    ]


def no_wall(model: mujoco.MjModel, geom: int) -> str:
    """Why a geom that rays see is no wall."""
    return (
        "rays see it, but the shell cannot hit it: "
        f'contype="{model.geom_contype[geom]}" '
        f'conaffinity="{model.geom_conaffinity[geom]}"; expected 1 of a wall'
    )


def _found(model: mujoco.MjModel) -> list[Finding]:
    """Findings about the walls' number, kinds and names, and the arena's size."""
    geoms = np.flatnonzero(walls(model)).tolist()
    box = box_around_walls(model)
    if box is None:
        return []
    kinds = Counter(_kind(model, geom) for geom in geoms)
    named = [name for geom in geoms if (name := model.geom(geom).name)]
    size = box[1] - box[0]
    return [
        info(
            TOPIC,
            f"{len(geoms)} found: "
            + ", ".join(f"{count} of type {kind}" for kind, count in kinds.items()),
        ),
        *([info(TOPIC, f"names: {names(named)}")] if named else []),
        info(
            TOPIC,
            f"box around them: x {box[0][0]:.3f} to {box[1][0]:.3f} m, "
            f"y {box[0][1]:.3f} to {box[1][1]:.3f} m, "
            f"z {box[0][2]:.3f} to {box[1][2]:.3f} m "
            f"({size[0]:.2f} x {size[1]:.2f} m)",
        ),
    ]


def _hidden(
    scene: Scene, grid: Grid, geom: int, place: Place, heights: Heights
) -> list[Finding]:
    """Finding about a wall above or below robots, if they do not meet it."""
    low, high = extent(scene.model, geom)
    if high <= heights.shell[0]:
        if high > heights.shell[0] - START_CLEARANCE:
            text = "it lies below the shell, so no robot may start near it; expected "
            text += f"the floor at its height (the floor is at {mm(scene.height)}), or "
            text += 'contype="0" conaffinity="0" if robots drive over it'
            return [error(TOPIC, text, place)]
        below = f"the robot passes above it: it ends at {mm(high)}"
    else:
        below = f"the robot passes below it: it begins at {mm(low)}"
        below += f", the shell ends at {mm(heights.shell[1])}"
    (outline,) = geom_outlines(scene, np.arange(scene.model.ngeom) == geom)
    meets = within(outline, grid.nodes[grid.inside]).any()
    return [warning(TOPIC, below, place)] if meets else []


def _mesh(model: mujoco.MjModel, geom: int, place: Place) -> list[Finding]:
    """Finding about a mesh with hollows: rays see them, the shell hits its hull."""
    if model.geom_type[geom] != _SHAPE.mjGEOM_MESH:
        return []
    vertices, faces = mesh(model, geom)
    corners = vertices.astype(float)[faces]
    volume = abs(np.linalg.det(corners).sum()) / 6
    try:
        hull = ConvexHull(vertices).volume
    except QhullError:
        hull = 0.0
    if volume >= (1 - CONCAVE) * hull:
        return []
    text = "a mesh with hollows: rays see them, but the robot hits its convex hull"
    return [warning(TOPIC, text, place)]


def _kind(model: mujoco.MjModel, geom: int) -> str:
    return _SHAPE(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
