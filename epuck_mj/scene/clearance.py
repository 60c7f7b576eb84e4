"""Clearance: how far the shell is from the nearest wall, by true geometry.

MuJoCo's own distance between convex shapes, so any arena will do. Of many walls, only
those near a pose are measured, which changes no result.

The robot stands upright on its start height, as on a flat floor. Distances are those in
space, which beside upright walls are those in the plane.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.boxes import boxes
from epuck_mj.scene.geometry import walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.nearest import CLEARANCE_MAX, NearestWall, at_start
from epuck_mj.scene.robot_parts import SHELL

PROBES_MAX = 500
"""Most groups of walls that are kept for the next measurement."""

CHUNK, FEW = 8192, 256
"""Numbers of poses measured at once, by one probe or by one of many.

They bound memory and change no result.
"""

WALLS_MAX = 30
"""Most walls that are all measured for every pose; of more, those near it."""

SQUARES = ((0.1, 0.04), (0.8, CLEARANCE_MAX))
"""Squares whose poses are measured with the same walls: their sides, and how far from
a shell walls are looked for [m]. The second are for poses beside which the first found
none."""

_SHAPE = mujoco.mjtGeom

MEASURED = {
    _SHAPE.mjGEOM_PLANE,
    _SHAPE.mjGEOM_SPHERE,
    _SHAPE.mjGEOM_CAPSULE,
    _SHAPE.mjGEOM_ELLIPSOID,
    _SHAPE.mjGEOM_CYLINDER,
    _SHAPE.mjGEOM_BOX,
    _SHAPE.mjGEOM_MESH,
}
"""Shapes with an exact distance; a mesh counts as its hull, as in collisions."""


@dataclass(frozen=True, eq=False)
class Clearance:
    """Nearest walls of robots on poses `(...)`; NaN where the pose is NaN.

    Attributes:
        distance: from the shell to the nearest wall [m], `(...)`: negative inside it,
            CLEARANCE_MAX if no wall is nearer than that.
        direction: of the nearest wall point from the robot's axis, in the world
            [rad], `(...)`; NaN if no wall is nearer than CLEARANCE_MAX.
    """

    distance: np.ndarray
    direction: np.ndarray


class ClearanceProbe:
    """Measures clearance in one scene."""

    def __init__(self, scene: Scene, threads: int = 0):
        """Look at the walls.

        Args:
            scene: robot and arena.
            threads: threads that measure; 0 is one per core.

        Raises:
            UserError: if a shape has no exact distance.
        """
        self._scene, self._threads = scene, threads
        solid = walls(scene.model)
        _check_shapes(scene, solid)
        self._walls = np.flatnonzero(solid)
        self._data = at_start(scene)
        self._probes: dict[tuple[int, ...], NearestWall] = {}
        self._many = self._walls.size > WALLS_MAX
        if self._many:
            low, high = boxes(scene.model, self._walls)
            self._low, self._high = low[:, :2], high[:, :2]

    def measure(self, poses: np.ndarray) -> Clearance:
        """Clearance `(...)` on poses `(..., 3)`: x, y [m], yaw [rad], or NaN."""
        distance = np.full(poses.shape[:-1], np.nan)
        direction = np.full(poses.shape[:-1], np.nan)
        there = np.isfinite(poses).all(axis=-1)
        distance[there], direction[there] = self._measure(poses[there])
        return Clearance(distance, direction)

    def _measure(self, poses: np.ndarray) -> np.ndarray:
        """Distance and direction `(2, n)` on `(n, 3)` poses."""
        if not self._many:
            return self._probe(self._walls).measure(poses)
        found, rest = np.empty((2, len(poses))), np.arange(len(poses))
        for side, reach in SQUARES:
            for part in _by_square(poses[rest], side):
                which = rest[part]
                near = self._near(poses[which[0]], side, reach)
                found[:, which] = self._probe(near).measure(poses[which])
            # a wall that was left out may be as near as the nearest one
            rest = rest[found[0, rest] >= reach]
        return found

    def _near(self, pose: np.ndarray, side: float, reach: float) -> np.ndarray:
        """Walls within reach of shells whose axis is in the square of a pose `(3,)`."""
        shell = self._scene.model.geom(SHELL)
        reach += shell.rbound.item() + np.hypot(*shell.pos[:2])
        low = side * np.floor(pose[:2] / side)
        near = (self._high > low - reach) & (self._low < low + side + reach)
        return self._walls[near.all(axis=1)]

    def _probe(self, near: np.ndarray) -> NearestWall:
        """The probe of some walls, by their indices."""
        key = tuple(near.tolist())
        if key not in self._probes:
            if len(self._probes) == PROBES_MAX:
                self._probes.clear()
            # of many, each takes as little as it can
            size, threads = (FEW, 1) if self._many else (CHUNK, self._threads)
            made = NearestWall(self._scene.model, self._data, key, size, threads)
            self._probes[key] = made
        return self._probes[key]


def beside_wider(distance: np.ndarray, wider: np.ndarray) -> np.ndarray:
    """Clearance of shells that are so much wider than those of `distance` [m].

    Exact beside upright walls.
    """
    return np.where(distance < CLEARANCE_MAX, distance - wider, distance)


def _by_square(poses: np.ndarray, side: float) -> list[np.ndarray]:
    """Indices of poses `(n, 3)` by the square of a side [m] that they are in."""
    square = np.floor(poses[:, :2] / side)
    order = np.lexsort(square.T)
    new = np.diff(square[order], axis=0).any(axis=1)
    return np.split(order, np.flatnonzero(new) + 1) if len(poses) else []


def _check_shapes(scene: Scene, solid: np.ndarray) -> None:
    for geom in np.flatnonzero(solid).tolist():
        shape = _SHAPE(scene.model.geom_type[geom])
        if shape not in MEASURED:
            name = shape.name.removeprefix("mjGEOM_").lower()
            raise UserError(
                f"arena '{scene.arena}': no clearance to a wall that is a {name}; "
                "expected plane, box, cylinder, capsule, ellipsoid, sphere or mesh"
            )
