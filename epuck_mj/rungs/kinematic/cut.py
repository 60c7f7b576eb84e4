"""Outlines of geoms, seen from above.

Rays meet what lies at their height. An upright shell touches a convex solid where the
solid's part between the shell's bottom and top, seen from above, comes nearer than the
shell's radius. So all outlines are flat: sides of polygons, and ellipses. They are
exact; a geom without such an outline is refused.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from epuck_mj.scene.geometry import mesh

_SHAPE = mujoco.mjtGeom

UPRIGHT = 1e-9
"""How far from 0 or 1 the vertical part of an upright geom's axis may be."""

PLANE_SIZE = 1e5
"""Half length of the outline of an endless plane [m]."""

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
EDGES = [
    (i, j)
    for i in range(8)
    for j in range(i)
    if np.abs(CORNERS[i] - CORNERS[j]).sum() == 2
]


class NoOutline(ValueError):
    """A geom has no exact outline."""


@dataclass
class Outlines:
    """Flat outlines.

    Attributes:
        segments: ends x, y, x, y [m], of each.
        ellipses: middle x, y, direction of the first axis x, y, both half axes [m].
    """

    segments: list[tuple[float, ...]] = field(default_factory=list)
    ellipses: list[tuple[float, ...]] = field(default_factory=list)

    def add_polygon(self, corners: np.ndarray) -> None:
        """Add the sides of the convex hull of points `(n, 2)`."""
        if len(corners) < 2:
            return
        try:
            corners = corners[ConvexHull(corners).vertices]
        except QhullError:
            # on one line: its two ends
            far = corners[np.argmax(np.hypot(*(corners - corners[0]).T))]
            other = corners[np.argmax(np.hypot(*(corners - far).T))]
            corners = np.array([far, other])
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            self.segments.append((*start, *end))

    def add_circle(self, middle: np.ndarray, radius: float) -> None:
        """Add a circle around `(2,)`."""
        if radius > 0:
            self.ellipses.append((*middle, 1.0, 0.0, radius, radius))


def add_outline(
    found: Outlines,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    low: float,
    high: float,
) -> None:
    """Add the outline of a geom between two heights [m], which may be equal.

    Raises:
        NoOutline: if it has none that is exact.
    """
    kind, size = _SHAPE(model.geom_type[geom]), model.geom_size[geom]
    middle, rotation = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    match kind:
        case _SHAPE.mjGEOM_PLANE:
            _plane(found, size, middle, rotation, low, high)
        case _SHAPE.mjGEOM_BOX:
            corners = middle + (CORNERS * size) @ rotation.T
            found.add_polygon(_between(corners, EDGES, low, high))
        case _SHAPE.mjGEOM_MESH:
            _mesh(found, model, geom, middle, rotation, low, high)
        case _SHAPE.mjGEOM_SPHERE:
            found.add_circle(middle[:2], _ball(size[0], middle[2], low, high))
        case _SHAPE.mjGEOM_ELLIPSOID:
            _ellipsoid(found, size, middle, rotation, low, high)
        case _SHAPE.mjGEOM_CYLINDER | _SHAPE.mjGEOM_CAPSULE:
            _round(found, kind, size, middle, rotation, low, high)
        case _:
            raise NoOutline(f"a {kind.name.removeprefix('mjGEOM_').lower()} has none")


def _between(
    corners: np.ndarray, edges: list[tuple[int, int]], low: float, high: float
) -> np.ndarray:
    """Points `(n, 2)` whose hull is the part of a convex solid between two heights."""
    z = corners[:, 2]
    points = [corners[(z >= low) & (z <= high), :2]]
    for height in {low, high}:
        for i, j in edges:
            if (z[i] < height) != (z[j] < height):
                share = (height - z[i]) / (z[j] - z[i])
                points.append(
                    (corners[i] + share * (corners[j] - corners[i]))[None, :2]
                )
    return np.concatenate(points)


def _plane(found, size, middle, rotation, low: float, high: float) -> None:
    """The line behind which the robot must not be.

    A shell meets all of a plane, rays only what is drawn of it.
    """
    normal = rotation[:, 2]
    flat = float(np.hypot(*normal[:2]))
    if flat < UPRIGHT:
        return
    # of a leaning one, where it stands farthest out
    height = low if normal[2] > 0 else high
    outward = normal[:2] / flat
    base = middle[:2] - outward * (height - middle[2]) * normal[2] / flat
    along = np.array([-outward[1], outward[0]])
    first, last = -PLANE_SIZE, PLANE_SIZE
    if low == high:
        place = np.append(base, height) - middle
        for axis in range(2):
            at, step = place @ rotation[:, axis], along @ rotation[:2, axis]
            if size[axis] <= 0:
                continue
            if abs(step) < UPRIGHT:
                if abs(at) > size[axis]:
                    return
                continue
            ends = sorted(((-size[axis] - at) / step, (size[axis] - at) / step))
            first, last = max(first, ends[0]), min(last, ends[1])
    if first < last:
        found.segments.append((*(base + first * along), *(base + last * along)))


def _mesh(found, model, geom: int, middle, rotation, low: float, high: float) -> None:
    """Rays see a mesh's faces; a shell touches its convex hull."""
    vertices, faces = mesh(model, geom)
    corners = middle + vertices.astype(float) @ rotation.T
    if low == high:
        for triangle in corners[faces]:
            cut = _between(triangle, [(0, 1), (1, 2), (2, 0)], low, high)
            if len(cut) >= 2:
                found.segments.append((*cut[0], *cut[1]))
        return
    hull = ConvexHull(corners)
    edges = {tuple(sorted((s[i], s[i - 1]))) for s in hull.simplices for i in range(3)}
    found.add_polygon(_between(corners, sorted(edges), low, high))


def _ball(radius: float, middle: float, low: float, high: float) -> float:
    """Radius of a ball's widest part between two heights; 0 if it has none."""
    off = middle - min(max(middle, low), high)
    return float(np.sqrt(max(radius**2 - off**2, 0.0)))


def _ellipsoid(found, size, middle, rotation, low: float, high: float) -> None:
    up = int(np.abs(rotation[2]).argmax())
    if abs(rotation[2, up]) < 1 - UPRIGHT:
        raise NoOutline("an ellipsoid has none unless one of its axes is upright")
    share = _ball(1.0, middle[2] / size[up], low / size[up], high / size[up])
    first, second = (axis for axis in range(3) if axis != up)
    if share > 0:
        axes = share * size[first], share * size[second]
        found.ellipses.append((*middle[:2], *rotation[:2, first], *axes))


def _round(found, kind, size, middle, rotation, low: float, high: float) -> None:
    """Cylinders and capsules that stand or lie."""
    radius, half = size[:2]
    axis, capped = rotation[:, 2], kind == _SHAPE.mjGEOM_CAPSULE
    if abs(axis[2]) > 1 - UPRIGHT:
        # the heights of its middle part, and how far beyond these a cap is cut
        bottom, top = middle[2] - half, middle[2] + half
        off = max(low - top, bottom - high, 0.0)
        if not capped and off > 0:
            return
        width = float(np.sqrt(max(radius**2 - off**2, 0.0)))
        found.add_circle(middle[:2], width)
        return
    if abs(axis[2]) > UPRIGHT:
        name = kind.name.removeprefix("mjGEOM_").lower()
        raise NoOutline(f"a {name} has none unless it stands or lies")
    width = _ball(radius, middle[2], low, high)
    if width == 0:
        return
    along = half * axis[:2]
    across = width * np.array([-axis[1], axis[0]])
    ends = middle[:2] + np.array([-along, along])
    if not capped:
        found.add_polygon(
            np.array([end + side for end in ends for side in (-across, across)])
        )
        return
    for side in (-across, across):
        found.segments.append((*(ends[0] + side), *(ends[1] + side)))
    for end in ends:
        found.add_circle(end, width)
