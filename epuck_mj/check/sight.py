"""Findings about what rays see where the robot can touch something.

Robots are put to the outlines of things, headed straight at them. What counts is what
the shell meets there and what rays see there, from whichever geom.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy import ndimage

from epuck_mj.check.findings import Finding, error, warning
from epuck_mj.check.heights import Heights, extent, mm
from epuck_mj.check.source import Places
from epuck_mj.check.walls import no_wall
from epuck_mj.constants import BODY_RADIUS, PROXIMITY_RANGE
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.geometry import kinematics, seen_by_rays, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.outline import geom_outlines
from epuck_mj.scene.robot_parts import SHELL, of_robot, static
from epuck_mj.scene.starts import Grid
from epuck_mj.step.control import START_CLEARANCE

TOPIC = "walls"

STEP = 0.005
"""Distance of the places on an outline that are tried [m]."""

FINE_STEP = 0.0005
"""The same on sides so short that rays may pass on both of their ends [m]."""

SHORT = 0.04
"""Length of such sides [m]."""

PLACES_MAX = 50_000
"""Most places that are tried in an arena."""

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


def sight_findings(
    scene: Scene, grid: Grid, places: Places, heights: Heights
) -> list[Finding]:
    """Findings about walls that rays do not see, and seen things that are no walls."""
    model = scene.model
    solid = walls(model)
    ghost = static(model) & ~solid & seen_by_rays(model)
    ghost &= ~of_robot(model)
    met = _meetings(scene, grid, solid | ghost, sum(heights.rays) / 2)
    unseen = met.touches & (met.behind > PROXIMITY_RANGE)
    deep = met.touches & ~unseen & (met.behind > DEPTH)
    blind = met.touches & ~unseen & (met.ahead > PROXIMITY_RANGE)
    through = met.passes & (np.abs(met.behind) <= TOUCH)
    findings = []
    for geom in np.unique(met.geom).tolist():
        of_geom, place = met.geom == geom, places.geom(geom)
        if (of_geom & unseen).any():
            text = f"rays cannot see it: {_why(model, geom, heights)}"
            where = _where(met.poses[of_geom & unseen])
            findings.append(error(TOPIC, text, place, where))
        elif (of_geom & deep).any():
            depth = met.behind[of_geom & deep].max()
            text = f"rays see a wall {mm(depth)} behind where the shell touches it"
            where = _where(met.poses[of_geom & deep])
            findings.append(warning(TOPIC, text, place, where))
        elif (of_geom & blind).any():
            text = "too thin for single rays: straight ahead, a robot sees nothing "
            where = _where(met.poses[of_geom & blind])
            findings.append(warning(TOPIC, text + "until it crashes", place, where))
        elif (of_geom & through).any():
            findings.append(warning(TOPIC, no_wall(model, geom), place))
    return findings


def same_view(scene: Scene, other: Scene) -> bool:
    """Whether two robots hit and see alike in one arena, so one check will do."""
    views = []
    for one in (scene, other):
        _, _, origin, direction = kinematics(one, np.zeros((1, 3)))
        shell = one.model.geom(SHELL)
        low, high = extent(one.model, shell.id)
        views.append(
            np.concatenate([*origin[0], *direction[0], shell.size, [low, high]])
        )
    return np.allclose(*views, rtol=0, atol=TOUCH / 10)


def _why(model: mujoco.MjModel, geom: int, heights: Heights) -> str:
    """Why rays do not see a geom that the shell touches."""
    low, high = extent(model, geom)
    if not seen_by_rays(model)[geom]:
        material = model.geom_matid[geom]
        of = f" of material '{model.material(material).name}'" if material >= 0 else ""
        return f"alpha 0{of}; expected more"
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
        size = " x ".join(f"{half:g}" for half in model.geom_size[geom, :2])
        return f"rays see a plane within its size only, {size} m; expected more, or 0"
    if high < heights.rays[0]:
        return f"it ends at {mm(high)}, rays run at {mm(heights.rays[0])}"
    if low > heights.rays[1]:
        return f"it begins at {mm(low)}, rays run at {mm(heights.rays[1])}"
    return f"where the shell touches it, there is nothing within {mm(PROXIMITY_RANGE)}"


def _where(poses: np.ndarray) -> str:
    x, y, _ = poses[len(poses) // 2]
    return f" (near x {x:.2f} m, y {y:.2f} m)"


def _meetings(scene: Scene, grid: Grid, geoms: np.ndarray, height: float) -> Meetings:
    """Meetings with the geoms of a mask, where the robot has room to stand."""
    index, poses = _approaches(scene, grid, geoms)
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


def _approaches(
    scene: Scene, grid: Grid, geoms: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Indices `(n,)` of geoms and poses `(n, 3)` that touch their outlines."""
    # a robot that touches is nearer to walls than it may start
    reach = int(np.ceil(START_CLEARANCE / grid.spacing)) + 1
    near = np.asarray(ndimage.binary_dilation(grid.inside, np.ones((3, 3)), reach))
    found, numbers = [], []
    outlines = geom_outlines(scene, geoms)
    for geom, outline in zip(np.flatnonzero(geoms).tolist(), outlines, strict=True):
        poses = np.concatenate(list(_around(outline)))
        node = np.round((poses[:, :2] - grid.origin) / grid.spacing).astype(int)
        # outside of the grid, it is its edge that counts
        x, y = np.clip(node, 0, np.array(near.shape) - 1).T
        there: np.ndarray = near[x, y]
        found.append(poses[there])
        numbers.append(np.full(there.sum(), geom))
    index, poses = np.concatenate(numbers), np.concatenate(found)
    stride = max(1, -(-len(poses) // PLACES_MAX))
    return index[::stride], poses[::stride]


def _around(outline: np.ndarray) -> Iterator[np.ndarray]:
    """Poses `(n, 3)` that touch a convex outline `(points, 2)`, headed at it."""
    angles = np.linspace(0, 2 * np.pi, len(outline), endpoint=False)
    yield _headed(outline, angles)
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        length = float(np.hypot(*(end - start)))
        if length > TOUCH / 10:
            n = 2 + int(length / (FINE_STEP if length < SHORT else STEP))
            share = np.linspace(0, 1, n)[:, None]
            along = np.arctan2(*(end - start)[::-1])
            # counterclockwise: outside is on the right
            yield _headed(start + share * (end - start), np.full(n, along - np.pi / 2))


def _headed(points: np.ndarray, outward: np.ndarray) -> np.ndarray:
    normal = np.stack([np.cos(outward), np.sin(outward)], axis=1)
    yaw = np.arctan2(-normal[:, 1], -normal[:, 0])
    return np.concatenate([points + BODY_RADIUS * normal, yaw[:, None]], axis=1)


def _rays(
    scene: Scene, poses: np.ndarray, heading: np.ndarray, height: float
) -> np.ndarray:
    """Distances [m] from poses `(n, 3)` straight ahead, `(n,)`; infinite: nothing.

    The least of rays side by side, since one may just pass a corner.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    # the robot itself is out of the way
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


SIDES = (0.0005, -0.0005, 0.01, -0.01)
"""Distances of these rays to the left of the middle [m]."""


FAR = 1000.0
"""Where a robot is out of the way [m]."""


def _ahead(scene: Scene, poses: np.ndarray) -> np.ndarray:
    """Least distance that the rays to the front measure [m], `(n,)`."""
    _, _, _, direction = kinematics(scene, np.zeros((1, 3)))
    front = direction[0, :, 0] >= FRONT
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


NEARBY = 0.8
"""Side of the squares by which poses are sorted [m]."""

CHUNK = 1024
"""Number of poses measured at once: bounds memory, changes no result."""
