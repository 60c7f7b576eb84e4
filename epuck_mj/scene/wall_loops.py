"""Wall loops: the lines along the walls on which laps are counted.

A loop is a closed line of equal clearance: one along the outer walls of an arena of
any shape, and one around each island. Robots near a wall are where the nearest loop
point is.
"""

from dataclasses import dataclass

import contourpy
import numpy as np
from scipy.spatial import KDTree

from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import Scene, once_per_model
from epuck_mj.scene.starts import FreeSpace

LOOP_CLEARANCE = 0.02
"""Clearance of the loops [m]: half of the clearance that counts as near a wall."""

POINT_SPACING = 0.002
"""Distance of loop points [m]: far less than the 13 mm of a control step."""

BIN = 0.05
"""Length of a loop's parts, each visited or not [m]: more than a cut corner skips."""

ABSENCE_MAX = 0.15
"""Longest way away from walls that still counts as following [m]: a cut corner.

A robot that crosses the arena makes no progress along its walls by that.
"""

DETOUR_MAX = 2.0
"""Most progress along a loop per distance driven: inside a bend it exceeds 1.

More, and it is the nearest point that has jumped, as between two walls of a corridor.
"""

CORNER_CUT = 2 * (PROXIMITY_RANGE - LOOP_CLEARANCE)
"""Length that the nearest loop point skips at a right corner at full range [m]."""


@dataclass(frozen=True, eq=False)
class LoopProgress:
    """Progress of `(n,)` robots along `(loops,)` loops.

    Attributes:
        net: along each loop, back and forth cancelled [m], `(n, loops)`; the sign is
            the sense of the loop.
        perimeter_share: share of all loops' bins that were visited, `(n,)`.
    """

    net: np.ndarray
    perimeter_share: np.ndarray


@dataclass(frozen=True, eq=False)
class WallLoops:
    """The loops of one scene, as points.

    Attributes:
        points: of all loops, one after the other [m], `(points, 2)`.
        loop: whose point it is, `(points,)`.
        arc: way along the loop to the point [m], `(points,)`.
        length: of each loop [m], `(loops,)`.
    """

    points: np.ndarray
    loop: np.ndarray
    arc: np.ndarray
    length: np.ndarray

    def progress(self, poses: np.ndarray, near: np.ndarray) -> LoopProgress:
        """Progress of robots along the walls.

        Args:
            poses: `(n, rows, 3)`: x, y [m], yaw [rad], NaN after the end.
            near: which of them are near a wall, `(n, rows)`.
        """
        way = way_driven(poses)
        robot, row = np.nonzero(near)
        _, nearest = KDTree(self.points).query(poses[robot, row, :2])
        loop, arc = self.loop[nearest], self.arc[nearest]
        # from one moment near a wall to the next, the shorter way around
        length = self.length[loop[1:]]
        step = np.diff(arc)
        step -= length * np.round(step / length)
        driven = np.diff(way[robot, row])
        along = (np.diff(robot) == 0) & (np.diff(loop) == 0)
        along &= driven <= ABSENCE_MAX
        along &= np.abs(step) <= DETOUR_MAX * driven + CORNER_CUT
        net = np.zeros((len(poses), self.length.size))
        np.add.at(net, (robot[1:][along], loop[1:][along]), step[along])
        return LoopProgress(net, self._visited(robot, loop, arc, len(poses)))

    def _visited(
        self, robot: np.ndarray, loop: np.ndarray, arc: np.ndarray, n: int
    ) -> np.ndarray:
        """Share of the loops' bins that each of `n` robots visited, `(n,)`."""
        bins = np.maximum(np.round(self.length / BIN), 1).astype(int)
        first = np.cumsum(bins) - bins
        visited = np.zeros((n, bins.sum()), bool)
        place = (arc / self.length[loop] * bins[loop]).astype(int)
        visited[robot, first[loop] + place] = True
        return visited.mean(axis=1)


def way_driven(poses: np.ndarray) -> np.ndarray:
    """Length of the path up to each of `(n, rows, 3)` poses [m], `(n, rows)`.

    It does not grow where poses are NaN.
    """
    steps = np.nan_to_num(
        np.hypot(*np.moveaxis(np.diff(poses[..., :2], axis=1), -1, 0))
    )
    return np.cumsum(np.pad(steps, ((0, 0), (1, 0))), axis=1)


@once_per_model
def wall_loops(scene: Scene) -> WallLoops:
    """The loops of a scene, for robots inside its walls.

    Raises:
        UserError: if no walls, no room or no inside is there, or a wall of which no
            clearance can be measured.
    """
    grid = FreeSpace(scene, LOOP_CLEARANCE).grid
    poses = np.zeros((*grid.inside.shape, 3))
    poses[..., :2] = grid.nodes
    clearance = ClearanceProbe(scene, 1).measure(poses).distance
    # no loops around the arena, nor in rooms within walls
    clearance[~grid.inside] = np.minimum(clearance[~grid.inside], LOOP_CLEARANCE)
    x, y = poses[:, 0, 0], poses[0, :, 1]
    lines = contourpy.contour_generator(x, y, clearance.T).lines(LOOP_CLEARANCE)
    loops = [_evenly(np.asarray(line)) for line in lines]
    points, arcs, lengths = zip(*loops, strict=True)
    return WallLoops(
        points=np.concatenate(points),
        loop=np.repeat(np.arange(len(arcs)), [arc.size for arc in arcs]),
        arc=np.concatenate(arcs),
        length=np.array(lengths),
    )


def _evenly(line: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Points at equal distances along a closed line `(m, 2)`, and its length.

    Returns:
        Points `(n, 2)`, the way to each of them `(n,)`, and all the way round [m].
    """
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    length = float(way[-1])
    arc = np.linspace(0, length, int(np.ceil(length / POINT_SPACING)), endpoint=False)
    points = np.stack([np.interp(arc, way, xy) for xy in line.T], axis=1)
    return points, arc, length
