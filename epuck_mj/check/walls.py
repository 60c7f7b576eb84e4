"""Findings about walls, and whether rays see what the robot can hit.

MuJoCo's rangefinders look for geoms of any group and any collision bits. They pass
through those of alpha 0, where a material's alpha counts before the geom's own.
"""

from collections import Counter
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from epuck_mj.check.findings import Finding, Place, error, info, warning
from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.scene.clearance import CONVEX
from epuck_mj.scene.geometry import at_rest, box_around, kinematics, mesh, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import ROBOT_BODY, SHELL, can_touch, static
from epuck_mj.step.control import START_CLEARANCE

TOPIC = "walls"
NAMES_MAX = 6
FLOOR_BITS = 'contype="2" conaffinity="2"'

FAR = 1e4
"""Distance beyond any wall [m]."""

CONCAVE = 0.01
"""Share of a hull's volume that its mesh may leave empty and still count as convex."""

_SHAPE = mujoco.mjtGeom


@dataclass(frozen=True)
class Heights:
    """Heights in which a robot can hit and see [m]."""

    shell: tuple[float, float]
    rays: tuple[float, float]


def finite_findings(model: mujoco.MjModel, places: tuple[Place, ...]) -> list[Finding]:
    """Errors for geoms so far away that nothing can be measured with them."""
    data = at_rest(model)
    values = np.concatenate([data.geom_xpos, data.geom_xmat, model.geom_size], axis=1)
    nowhere = ~(np.abs(values) < FAR).all(axis=1)
    return [
        error(TOPIC, f"expected finite numbers below {FAR:g} m", places[geom])
        for geom in np.flatnonzero(nowhere).tolist()
    ]


def plane_findings(model: mujoco.MjModel, places: tuple[Place, ...]) -> list[Finding]:
    """Errors for planes that the shell would hit: no scene can be made with them."""
    planes = (model.geom_type == _SHAPE.mjGEOM_PLANE) & walls(model)
    data = at_rest(model)
    return [
        error(
            TOPIC,
            f"the robot's shell would hit this plane; expected {FLOOR_BITS} for a floor"
            if abs(data.geom_xmat[geom][8]) > 1 - 1e-9
            else "a plane cannot be a wall; expected a box",
            places[geom],
        )
        for geom in np.flatnonzero(planes).tolist()
    ]


def wall_findings(scene: Scene, places: tuple[Place, ...]) -> list[Finding]:
    """Findings about the geoms of an arena."""
    model, heights = scene.model, heights_of(scene)
    robot = model.body_rootid == model.body(ROBOT_BODY).id
    findings = _found(model)
    for geom in np.flatnonzero(~robot[model.geom_bodyid]).tolist():
        place = places[geom]
        if not static(model)[geom]:
            findings += _moving(model, geom, place)
        elif walls(model)[geom]:
            findings += _wall(model, geom, place, heights)
        else:
            findings += _no_wall(model, geom, place, heights)
    return findings


def heights_of(scene: Scene) -> Heights:
    """Where shell and rays of a robot are, upright on a floor at 0."""
    model = scene.model
    shell = np.arange(model.ngeom) == model.geom(SHELL).id
    box = box_around(model, shell)
    assert box is not None, "the shell is no plane"
    _, _, origin, direction = kinematics(scene, np.zeros((1, 3)))
    ends = origin[..., 2], (origin + PROXIMITY_RANGE * direction)[..., 2]
    low, high = np.min(ends), np.max(ends)
    return Heights((box[0][2], box[1][2]), (float(low), float(high)))


def seen_by_rays(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms a rangefinder can hit, `(ngeom,)`; see `mj_ray`."""
    alpha, material = model.geom_rgba[:, 3].copy(), model.geom_matid
    alpha[material >= 0] = model.mat_rgba[material[material >= 0], 3]
    return alpha > 0


def _found(model: mujoco.MjModel) -> list[Finding]:
    """Findings about the walls' number, kinds and names, and the arena's size."""
    geoms = np.flatnonzero(walls(model)).tolist()
    box = box_around(model, walls(model))
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
    model: mujoco.MjModel, geom: int, place: Place, heights: Heights
) -> list[Finding]:
    """Finding about a geom that the shell can hit, if it is no good wall."""
    if _SHAPE(model.geom_type[geom]) not in CONVEX:
        kind = _kind(model, geom)
        text = f"a wall cannot be of type {kind}: clearance to it has no measure"
        return [error(TOPIC, text, place)]
    low, high = _extent(model, geom)
    if high <= heights.shell[0]:
        return _below(high, place, heights)
    if low >= heights.shell[1]:
        text = f"the robot passes below it: it begins at {_mm(low)}"
        text += f", the shell ends at {_mm(heights.shell[1])}"
        return [warning(TOPIC, text, place)]
    findings = _mesh(model, geom, place)
    if not seen_by_rays(model)[geom]:
        why = "alpha 0"
        material = model.geom_matid[geom]
        if material >= 0:
            why += f" of material '{model.material(material).name}'"
    elif high < heights.rays[0]:
        why = f"it ends at {_mm(high)}, rays run at {_mm(heights.rays[0])}"
    elif low > heights.rays[1]:
        why = f"it begins at {_mm(low)}, rays run at {_mm(heights.rays[1])}"
    else:
        return findings
    return [*findings, error(TOPIC, f"rays cannot see it: {why}", place)]


def _below(high: float, place: Place, heights: Heights) -> list[Finding]:
    """Finding about a geom with a wall's bits below the shell: probably a floor."""
    if high > heights.shell[0] - START_CLEARANCE:
        text = "it lies below the shell, which may start nowhere near it; "
        text += f"expected {FLOOR_BITS} for a floor"
        return [error(TOPIC, text, place)]
    text = f"the robot passes above it: it ends at {_mm(high)}"
    return [warning(TOPIC, text, place)]


def _no_wall(
    model: mujoco.MjModel, geom: int, place: Place, heights: Heights
) -> list[Finding]:
    """Finding about a geom that stands still and the shell cannot hit."""
    if model.geom_type[geom] == _SHAPE.mjGEOM_PLANE:
        in_sight = abs(at_rest(model).geom_xmat[geom][8]) < 1 - 1e-9
    else:
        low, high = _extent(model, geom)
        in_sight = low < heights.rays[1] and high > heights.rays[0]
    if not in_sight or not seen_by_rays(model)[geom]:
        return []
    bits = f'contype="{model.geom_contype[geom]}" '
    bits += f'conaffinity="{model.geom_conaffinity[geom]}"'
    text = f"rays see it, but the shell cannot hit it: {bits}; expected 1 of a wall"
    return [warning(TOPIC, text, place)]


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


def _extent(model: mujoco.MjModel, geom: int) -> tuple[float, float]:
    """Lowest and highest point of a geom that is no plane [m]."""
    box = box_around(model, np.arange(model.ngeom) == geom)
    assert box is not None, "only planes have no box"
    return float(box[0][2]), float(box[1][2])


def _kind(model: mujoco.MjModel, geom: int) -> str:
    return _SHAPE(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()


def _mm(height: float) -> str:
    return f"{height * 1000:.1f} mm"
