"""Findings about the geoms of an arena, one by one."""

from collections import Counter

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from epuck_mj.check.findings import Finding, Place, error, info, warning
from epuck_mj.check.heights import Heights, extent, mm
from epuck_mj.scene.clearance import MEASURED
from epuck_mj.scene.geometry import at_rest, box_around_walls, mesh, seen_by_rays, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.outline import geom_outlines, within
from epuck_mj.scene.robot_parts import ROBOT_BODY, SHELL, can_touch, static
from epuck_mj.scene.starts import Grid
from epuck_mj.step.control import START_CLEARANCE

TOPIC = "walls"
NAMES_MAX = 6

FAR = 1e4
"""Distance beyond any wall [m]."""

CONCAVE = 0.01
"""Share of a hull's volume that its mesh may leave empty and still count as convex."""

_SHAPE = mujoco.mjtGeom


def finite_findings(model: mujoco.MjModel, places: tuple[Place, ...]) -> list[Finding]:
    """Errors for geoms so far away that nothing can be measured with them."""
    data = at_rest(model)
    values = np.concatenate([data.geom_xpos, data.geom_xmat, model.geom_size], axis=1)
    nowhere = ~(np.abs(values) < FAR).all(axis=1)
    return [
        error(TOPIC, f"expected finite numbers below {FAR:g} m", places[geom])
        for geom in np.flatnonzero(nowhere).tolist()
    ]


def floor_findings(scene: Scene, places: tuple[Place, ...]) -> list[Finding]:
    """Information about what is taken for the floor though its bits are a wall's."""
    names = [places[geom].element or "<geom>" for geom in scene.floor]
    if not names:
        return []
    text = f"taken as the floor, since level at height 0: {', '.join(names)}"
    return [info("floor", text)]


def wall_findings(
    scene: Scene, grid: Grid, places: tuple[Place, ...], heights: Heights
) -> list[Finding]:
    """Findings about the geoms of an arena."""
    model = scene.model
    robot = model.body_rootid == model.body(ROBOT_BODY).id
    findings = _found(model)
    for geom in np.flatnonzero(~robot[model.geom_bodyid]).tolist():
        place = places[geom]
        if not static(model)[geom]:
            findings += _moving(model, geom, place)
        elif walls(model)[geom]:
            findings += _wall(scene, grid, geom, place, heights)
    return findings


def _found(model: mujoco.MjModel) -> list[Finding]:
    """Findings about the walls' number, kinds and names, and the arena's size."""
    geoms = np.flatnonzero(walls(model)).tolist()
    box = box_around_walls(model)
    if box is None:
        return []
    kinds = Counter(_kind(model, geom) for geom in geoms)
    names = [model.geom(geom).name or "no name" for geom in geoms]
    more = f" and {len(names) - NAMES_MAX} more" if len(names) > NAMES_MAX else ""
    size = box[1] - box[0]
    return [
        info(
            TOPIC,
            f"{len(geoms)} found: "
            + ", ".join(f"{count} of type {kind}" for kind, count in kinds.items()),
        ),
        info(TOPIC, f"names: {', '.join(names[:NAMES_MAX])}{more}"),
        info(
            TOPIC,
            f"box around them: x {box[0][0]:.3f} to {box[1][0]:.3f} m, "
            f"y {box[0][1]:.3f} to {box[1][1]:.3f} m, "
            f"z {box[0][2]:.3f} to {box[1][2]:.3f} m "
            f"({size[0]:.2f} x {size[1]:.2f} m)",
        ),
    ]


def _wall(
    scene: Scene, grid: Grid, geom: int, place: Place, heights: Heights
) -> list[Finding]:
    """Finding about a geom that the shell can hit, if robots do not meet it."""
    if _SHAPE(scene.model.geom_type[geom]) not in MEASURED:
        kind = _kind(scene.model, geom)
        text = f"a wall cannot be of type {kind}: clearance to it has no measure"
        return [error(TOPIC, text, place)]
    low, high = extent(scene.model, geom)
    if high <= heights.shell[0]:
        if high > heights.shell[0] - START_CLEARANCE:
            text = "it lies below the shell, which may start nowhere near it; expected "
            return [error(TOPIC, f"{text}a floor at height 0", place)]
        below = f"the robot passes above it: it ends at {mm(high)}"
    elif low >= heights.shell[1]:
        below = f"the robot passes below it: it begins at {mm(low)}"
        below += f", the shell ends at {mm(heights.shell[1])}"
    else:
        return _mesh(scene.model, geom, place)
    (outline,) = geom_outlines(scene, np.arange(scene.model.ngeom) == geom)
    meets = within(outline, grid.nodes[grid.inside]).any()
    return [warning(TOPIC, below, place)] if meets else []


def _moving(model: mujoco.MjModel, geom: int, place: Place) -> list[Finding]:
    """Finding about a moving geom that the shell can hit or rays can see."""
    hit = can_touch(model, model.geom(SHELL).id)[geom]
    if not hit and not seen_by_rays(model)[geom]:
        return []
    does = "touching it is a crash" if hit else "rays see it"
    text = f"it moves, so it is no wall: {does}, but no clearance or figure has it"
    return [warning(TOPIC, text, place)]


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
