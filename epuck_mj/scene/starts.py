"""Starts: poses in an arena of any shape where a robot may start.

Free means that the shell keeps a clearance to everything it can hit; inside means
that the robot could not be pushed from there to the outside of the walls.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy import ndimage

from epuck_mj.errors import UserError
from epuck_mj.scene.geometry import box_around_walls, walls
from epuck_mj.scene.model import Scene, once_per_model
from epuck_mj.scene.robot_parts import ROBOT_BODY, SHELL

NODES_MAX = 400
"""Most grid nodes along one side of the arena."""

SPACING_MIN = 0.01
"""Grid spacing [m], unless the arena is larger than NODES_MAX spacings."""

SIZE_MAX = 35.0
"""Longest side of an arena [m]: 500 times the robot's diameter."""

PROBED = 200
"""Number of places at which it is looked up what is in the way."""

IN_THE_WAY = 0.8
"""Least share of places at which one geom alone is in the way of all robots."""

BLOCK = 64
"""Number of candidates drawn at once; changing it changes all starts."""

BLOCKS_MAX = 1000
"""Least number of blocks drawn before giving up."""

DRAWS_MAX = 16
"""Number of candidates drawn for each start before giving up."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Grid over an arena with the nodes where a robot fits.

    Attributes:
        lower: corner of the box around the walls, `(2,)` [m].
        upper: its other corner, `(2,)` [m].
        origin: of the grid, one shell's width outside of that box, `(2,)` [m].
        spacing: between nodes [m].
        free: which nodes are far enough from everything, outside included, `(x, y)`.
        inside: which of them are enclosed by walls, `(x, y)`.
    """

    lower: np.ndarray
    upper: np.ndarray
    origin: np.ndarray
    spacing: float
    free: np.ndarray
    inside: np.ndarray

    @property
    def nodes(self) -> np.ndarray:
        """Places of the nodes, `(x, y, 2)` [m]."""
        return self.origin + self.spacing * np.moveaxis(
            np.indices(self.free.shape), 0, -1
        )

    def near_inside(self, points: np.ndarray) -> np.ndarray:
        """Whether one of the four nodes around points `(n, 2)` is inside, `(n,)`."""
        low = np.floor((points - self.origin) / self.spacing).astype(int)
        near = np.zeros(len(points), bool)
        for corner in np.ndindex(2, 2):
            near |= self.inside[tuple((low + corner).T)]
        return near


@once_per_model
def survey(scene: Scene, clearance: float) -> Grid:
    """Grid of the places where a robot fits, whether or not it may start there.

    Args:
        scene: robot and arena.
        clearance: least distance from the shell to anything it can hit [m].

    Raises:
        UserError: if no walls are there.
    """
    box = box_around_walls(scene.model)
    if box is None:
        raise UserError(
            f"arena '{scene.arena}' has no walls: expected geoms fixed to the "
            "world that the robot's shell can hit"
        )
    lower, upper = box[0][:2], box[1][:2]
    if not (upper - lower).max() < SIZE_MAX:
        raise UserError(
            f"arena '{scene.arena}' is {(upper - lower).max():g} m wide: expected less "
            f"than {SIZE_MAX:g} m, 500 times the robot's width of 7 cm; are its "
            "lengths in millimetres?"
        )
    # one shell's width of outside all around
    border = 2 * scene.model.geom(SHELL).rbound.item() + clearance
    size = upper - lower + 2 * border
    spacing = max(SPACING_MIN, size.max() / NODES_MAX)
    origin = lower - border
    nodes = np.ceil(size / spacing).astype(int) + 1
    shape = int(nodes[0]), int(nodes[1])
    poses = np.zeros((shape[0] * shape[1], 3))
    poses[:, :2] = origin + spacing * (np.indices(shape).reshape(2, -1).T)
    checks = Batch(_with_margin(scene.model, clearance), len(poses), 1)
    free = _free(checks, scene, poses).reshape(shape)
    return Grid(lower, upper, origin, spacing, free, enclosed(free))


def enclosed(free: np.ndarray) -> np.ndarray:
    """Mask `(x, y)` of the free nodes of a grid that have no way to its edge."""
    parts = np.empty(free.shape, np.int32)
    ndimage.label(free, output=parts)
    edge = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    return free & ~np.isin(parts, edge)


class FreeSpace:
    """The poses of a scene where a robot may start."""

    def __init__(self, scene: Scene, clearance: float):
        """Find the free space on a grid.

        Args:
            scene: robot and arena.
            clearance: least distance from the shell to anything it can hit [m].

        Raises:
            UserError: if no walls, no room or no inside is there.
        """
        self._scene = scene
        self._checks = Batch(_with_margin(scene.model, clearance), BLOCK, 1)
        grid = survey(scene, clearance)
        if not grid.inside.any():
            raise UserError(
                f"arena '{scene.arena}' has no room for a start: its walls "
                "leave no enclosed space where the robot keeps its start clearance"
            )
        self.grid = grid

    def sample(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """Uniform random starts `(n, 3)`: x, y [m], yaw [rad].

        Raises:
            UserError: if the free space is too small to be hit.
        """
        return self._accepted(lambda: rng.random((BLOCK, 3)), n)

    def spread(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """Starts `(n, 3)` that are spread evenly over places and directions.

        Scrambled Sobol points, which leave smaller gaps than random ones: means over
        them are nearer to means over all starts. A longer list begins with the shorter.

        Raises:
            UserError: as `sample`.

        Source: A. B. Owen, J. Complexity 14 (1998) 466-489, for the scrambling.
        """
        # slow to import, and needed only to choose or test champions
        from scipy.stats.qmc import Sobol

        points = Sobol(3, rng=rng)
        return self._accepted(lambda: points.random(BLOCK), n)

    def _accepted(self, draw: Callable[[], np.ndarray], n: int) -> np.ndarray:
        """The first `n` starts among candidates that are drawn in the unit cube.

        Args:
            draw: gives the next candidates, `(BLOCK, 3)` in [0, 1).
            n: number of starts.

        Raises:
            UserError: if the free space is too small to be hit.
        """
        starts, grid = np.zeros((0, 3)), self.grid
        blocks = max(BLOCKS_MAX, n * DRAWS_MAX // BLOCK)
        for _ in range(blocks):
            draws = draw()
            poses = np.empty_like(draws)
            poses[:, :2] = grid.lower + draws[:, :2] * (grid.upper - grid.lower)
            poses[:, 2] = np.pi * (2 * draws[:, 2] - 1)
            poses = poses[grid.near_inside(poses[:, :2])]
            poses = poses[_free(self._checks, self._scene, poses)]
            starts = np.concatenate([starts, poses])[:n]
            if len(starts) == n:
                return starts
        raise UserError(
            f"arena '{self._scene.arena}' has almost no room for a start: "
            f"{len(starts)} of {n} found among {BLOCK * blocks} candidates"
        )


def in_the_way(scene: Scene, grid: Grid) -> tuple[int, float] | None:
    """A geom that alone leaves no room for most robots between the walls, if any.

    Returns:
        Its index, and the share of places at which it is in the way.
    """
    model = _with_margin(scene.model, 0)
    if walls(model).sum() < 2:
        return None
    data, shell = mujoco.MjData(model), model.geom(SHELL).id
    within = ((grid.nodes > grid.lower) & (grid.nodes < grid.upper)).all(axis=-1)
    places = grid.nodes[within][:: max(1, within.sum() // PROBED)]
    blocking = np.zeros(model.ngeom)
    for place in places:
        data.qpos[:] = scene.qpos(np.array([*place, 0]))
        mujoco.mj_fwdPosition(model, data)
        pairs = {frozenset(contact.geom.tolist()) for contact in data.contact}
        met = {geom for pair in pairs if shell in pair for geom in pair - {shell}}
        blocking[list(met)] += 1
    share = blocking / max(1, len(places))
    most = int(share.argmax())
    return (most, float(share[most])) if share[most] >= IN_THE_WAY else None


def _with_margin(model: mujoco.MjModel, clearance: float) -> mujoco.MjModel:
    """The model with a shell that touches things already at a clearance [m]."""
    model = copy.copy(model)
    # of its sensors, only the contact counts: rays cost most
    rays = model.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER
    model.sensor_needstage[rays] = mujoco.mjtStage.mjSTAGE_ACC
    model.geom_margin[model.geom(SHELL).id] = clearance
    model.body_margin[model.body(ROBOT_BODY).id] = clearance
    return model


def _free(checks: Batch, scene: Scene, poses: np.ndarray) -> np.ndarray:
    """Whether the shell touches nothing on each pose `(n, 3)`, `(n,)`."""
    ids = np.arange(len(poses), dtype=np.int32)
    checks.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
    checks.bind("qpos")[ids] = scene.qpos(poses)
    sensordata = checks.bind("sensordata")
    checks.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
    return ~scene.reading(sensordata[ids]).contact
