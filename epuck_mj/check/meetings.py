"""Robots put to the outlines of things: what the shell meets there, what rays see."""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from epuck_mj.check.approaches import approaches
from epuck_mj.constants import BODY_RADIUS, N_PROXIMITY
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.geometry import kinematics, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.starts import Grid

TOUCH = 0.001
"""Largest distance that counts as touching [m]."""

ADVANCES = 3
"""How often robots advance by their clearance until they touch what they head at."""

FACING = np.cos(np.radians(10))
"""Least cosine of the angle between the heading and what the robot touches."""

DEPTH = 0.010
"""How far behind the place that a shell touches rays may see the wall [m]."""

FRONT = np.cos(np.radians(30))
"""Least cosine of the angle between the heading and a ray that counts as ahead."""

SIDES = (0.0005, -0.0005, 0.01, -0.01)
"""How far to the left of the middle the rays straight ahead begin [m]."""

FAR = 1000.0
"""Where a robot is out of the way [m]."""

NEARBY = 0.8
"""Side of the squares by which poses are sorted [m]."""

CHUNK = 1024
"""Number of poses measured at once: bounds memory, changes no result."""


@dataclass(frozen=True, eq=False)
class Meetings:
    """Robots that touch the outlines of geoms, headed at them.

    Attributes:
        geom: whose outline it is, `(n,)`.
        poses: x, y [m], yaw [rad], `(n, 3)`.
        behind: how far behind the outline rays straight ahead hit something [m],
            `(n,)`; infinite if nowhere.
        ahead: least distance that the robot's own rays to the front measure [m],
            `(n,)`; infinite if none hits anything.
        touches: whether the shell touches a wall straight ahead, `(n,)`.
        passes: whether nothing stops it, `(n,)`.
    """

    geom: np.ndarray
    poses: np.ndarray
    behind: np.ndarray
    ahead: np.ndarray
    touches: np.ndarray
    passes: np.ndarray


def meetings(scene: Scene, grid: Grid, geoms: np.ndarray, height: float) -> Meetings:
    """Meetings with the geoms of a mask, where the robot has room to stand."""
    index, poses = approaches(scene, grid, geoms)
    # what is near is measured together
    order = np.lexsort(np.floor(poses[:, :2] / NEARBY).T)
    probe = ClearanceProbe(scene, 1)
    parts = [
        _meet(scene, probe, index[some], poses[some], height)
        for some in np.array_split(order, len(order) // CHUNK + 1)
    ]
    together = zip(*(vars(part).values() for part in parts), strict=True)
    return Meetings(*(np.concatenate(values) for values in together))


def _meet(
    scene: Scene,
    probe: ClearanceProbe,
    index: np.ndarray,
    poses: np.ndarray,
    height: float,
) -> Meetings:
    """Meetings of robots on poses `(n, 3)` with the geoms `(n,)` they head at."""
    stands = probe.measure(poses).distance >= -TOUCH
    index, poses = index[stands], poses[stands]
    heading = np.stack(
        [np.cos(poses[:, 2]), np.sin(poses[:, 2]), np.zeros(len(poses))], axis=1
    )
    solid = walls(scene.model)[index]
    for _ in range(ADVANCES):
        # what leans is met behind its outline
        met = probe.measure(poses)
        facing = np.cos(met.direction - poses[:, 2]) >= FACING
        way = np.where(solid & facing, met.distance, 0)
        poses = poses + way[:, None] * heading * [1, 1, 0]
    met = probe.measure(poses)
    touches = np.abs(met.distance) <= TOUCH
    touches &= np.cos(met.direction - poses[:, 2]) >= FACING
    behind = np.full(len(poses), np.inf)
    # the other places are not asked about
    some = np.flatnonzero(touches | ~solid)
    behind[some] = _rays(scene, poses[some], heading[some], height) - BODY_RADIUS
    deeper = probe.measure(poses + DEPTH * heading * [1, 1, 0]).distance
    return Meetings(
        index,
        poses,
        behind,
        _ahead(scene, poses),
        solid & touches,
        ~solid & (deeper > 0),
    )


def _rays(
    scene: Scene, poses: np.ndarray, heading: np.ndarray, height: float
) -> np.ndarray:
    """Distances [m] from poses `(n, 3)` straight ahead, `(n,)`; infinite: nothing.

    The least of rays side by side, since one may just pass a corner.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    # the robot is far away, so that rays do not meet it
    data.qpos[:] = scene.qpos(np.array([FAR, FAR, 0.0]))
    mujoco.mj_kinematics(model, data)
    geom = np.zeros(1, np.int32)
    middle = np.concatenate([poses[:, :2], np.full((len(poses), 1), height)], axis=1)
    left = np.cross([0, 0, 1], heading)
    distance = np.full(len(poses), np.inf)
    for side in SIDES:
        # what is seen where it is touched cannot be seen better
        for i in np.flatnonzero(distance > BODY_RADIUS + TOUCH).tolist():
            origin = middle[i] + side * left[i]
            found = mujoco.mj_ray(model, data, origin, heading[i], None, 1, -1, geom)
            distance[i] = min(distance[i], found if found >= 0 else np.inf)
    return distance


def _ahead(scene: Scene, poses: np.ndarray) -> np.ndarray:
    """Least distance that the rays to the front measure [m], `(n,)`."""
    _, _, _, direction = kinematics(scene, np.zeros((1, 3)))
    front = direction[0, :N_PROXIMITY, 0] >= FRONT
    ahead = np.full(len(poses), np.inf)
    batch = Batch(scene.model, CHUNK, 1)
    qpos, sensordata = batch.bind("qpos"), batch.bind("sensordata")
    for first in range(0, len(poses), CHUNK):
        some = poses[first : first + CHUNK]
        ids = np.arange(len(some), dtype=np.int32)
        qpos[ids] = scene.qpos(some)
        batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        distance = scene.reading(sensordata[ids]).distance[:, front]
        seen = np.where(distance < 0, np.inf, distance).min(axis=1, initial=np.inf)
        ahead[first : first + CHUNK] = seen
    return ahead
