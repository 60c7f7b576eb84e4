"""Plan of a scene: all numbers of robot and arena that the kinematic rung needs."""

from typing import NamedTuple

import mujoco
import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.rungs.kinematic.cut import UPRIGHT, NoOutline, Outlines, add_outline
from epuck_mj.scene.boxes import at_rest
from epuck_mj.scene.geometry import kinematics, seen_by_rays, walls
from epuck_mj.scene.model import Scene, once_per_model
from epuck_mj.scene.robot_parts import PREFIX, ROBOT_BODY, SHELL, WHEELS, static
from epuck_mj.step.bodies import SPARE_SPEED

SUBSTEP = 0.02
"""Longest time between two looks at whether the shell touches a wall [s].

At full speed a robot moves 2.6 mm in it.
"""

REACH_MAX = 10.0
"""Rays with a longer reach [m] have no grid."""

CELLS_MAX = 250_000
"""Most cells of the grid."""

CELL = 0.05
"""Size of a cell of the grid [m], unless there were too many."""


class Body(NamedTuple):
    """Numbers of the robot.

    Attributes:
        shell: radius of the shell [m].
        wheel_radius: of the wheels [m].
        track: distance of the wheels [m].
        speed_max: of a wheel [rad/s].
    """

    shell: float
    wheel_radius: float
    track: float
    speed_max: float


class Grid(NamedTuple):
    """Where the cells of a grid are.

    Attributes:
        x: of its corner [m].
        y: likewise.
        cell: size of its cells [m].
        n_x: number of cells along x.
        n_y: along y.
    """

    x: float
    y: float
    cell: float
    n_x: int
    n_y: int


class Walls(NamedTuple):
    """Outlines, and which of them are near each cell of a grid.

    Attributes:
        grid: where the cells are.
        first: index in `near` of the first outline near each cell, `(cells + 2,)`; the
            last but one entry is for all places outside of the grid.
        near: outlines near the cells, one cell after the other: sides, then ellipses as
            numbers from n on.
        sides: start x, y and way to the end x, y [m], `(n, 4)`.
        ellipses: middle x, y, direction of the first axis x, y, half axes, `(m, 6)`.
    """

    grid: Grid
    first: np.ndarray
    near: np.ndarray
    sides: np.ndarray
    ellipses: np.ndarray


class Cones(NamedTuple):
    """Rays to the left and to the right of those in the middle of sensors.

    Attributes:
        rays: as in `Plan`, all to the left, then all to the right, `(4, 16)`; `(4, 0)`
            of sensors with one ray.
        cosines: of the angles to the middle rays, `(8,)` or `(0,)`.
    """

    rays: np.ndarray
    cosines: np.ndarray


class Plan(NamedTuple):
    """Robot and arena.

    Attributes:
        body: numbers of the robot.
        rays: origin x, y and direction x, y of each sensor's ray, or of the one in its
            middle, in the robot's frame, `(4, 8)`.
        cones: further rays of the sensors.
        lag: time constants of forward and of turning speed [s], `(2,)`.
        massless: the same of a robot without mass, with its drives only, `(2,)`.
        seen: what rays see within their reach of the robot.
        solid: what the shell can touch within a control step.
    """

    body: Body
    rays: np.ndarray
    cones: Cones
    lag: np.ndarray
    massless: np.ndarray
    seen: Walls
    solid: Walls


def plan_of(
    scene: Scene, reach: float, control_step: float, wider: float = 0.0
) -> Plan:
    """The plan of a scene.

    Args:
        scene: robot and arena.
        reach: farthest that rays have to see [m].
        control_step: its duration [s].
        wider: how much larger radii of shells there may be than the robot's [m].

    Raises:
        UserError: if the robot or a geom of the arena cannot be put into a plan.
    """
    body, rays, lag, massless = _robot(scene)
    cones = Cones(rays[:, N_PROXIMITY:].copy(), scene.cosines)
    # larger wheels turn faster, too
    way = SPARE_SPEED * control_step * body.speed_max * body.wheel_radius
    return Plan(
        body,
        rays[:, :N_PROXIMITY].copy(),
        cones,
        lag,
        massless,
        _walls(*_outlines(scene, False), body.shell + wider + reach),
        _walls(*_outlines(scene, True), body.shell + wider + way),
    )


def _robot(scene: Scene) -> tuple[Body, np.ndarray, np.ndarray, np.ndarray]:
    """The robot's numbers, rays and time constants, from its compiled MJCF.

    Raises:
        UserError: if its rays are not level or its shell is no upright cylinder.
    """
    model = scene.model
    _, _, origin, direction = kinematics(scene, np.zeros((1, 3)))
    origin, direction = origin[0], direction[0]
    heights = origin[:, 2]
    level = np.abs(direction[:, 2]).max() <= UPRIGHT and np.ptp(heights) <= UPRIGHT
    if not level:
        raise _unfit(scene, "rays that are level and at one height")
    shell = model.geom(SHELL)
    upright = abs(at_rest(model).geom_xmat[shell.id][8]) > 1 - UPRIGHT
    if shell.type != mujoco.mjtGeom.mjGEOM_CYLINDER or not upright:
        raise _unfit(scene, "a shell that is an upright cylinder")
    if np.abs(shell.pos[:2]).max() > 0:
        raise _unfit(scene, "a shell around the middle of the axle")
    radius, track, lag, massless = _axle(scene)
    speed_max = float(model.actuator_ctrlrange[scene.wheels[0], 1])
    body = Body(float(shell.size[0]), radius, track, speed_max)
    return body, np.hstack([origin[:, :2], direction[:, :2]]).T, lag, massless


def _axle(scene: Scene) -> tuple[float, float, np.ndarray, np.ndarray]:
    """Wheel radius, track, and time constants with and without the robot's mass.

    The wheels roll, so there are two motions only, ahead and around. The time constant
    of each is its inertia over the gain of the servos that drive it.

    Raises:
        UserError: if the robot has no two equal wheels with velocity servos.
    """
    model, data = scene.model, at_rest(scene.model)
    try:
        left, right = (model.geom(name) for name in WHEELS)
    except KeyError:
        names = " and ".join(name.removeprefix(PREFIX) for name in WHEELS)
        raise _unfit(scene, f"geoms {names} as its wheels") from None
    radius = float(left.size[0])
    track = float(data.geom_xpos[left.id, 1] - data.geom_xpos[right.id, 1])
    gains = model.actuator_gainprm[scene.wheels, 0]
    dofs = model.jnt_dofadr[model.actuator_trnid[scene.wheels, 0]]
    if gains[0] != gains[1] or right.size[0] != radius or gains[0] <= 0 or track <= 0:
        raise _unfit(scene, "two equal wheels with velocity servos")
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, inertia)
    base = model.body_dofadr[model.body(ROBOT_BODY).id]
    moves = np.zeros((2, model.nv))
    # per rad/s of both wheels: ahead; of the right one and back with the left: around
    moves[:, dofs] = [[1, 1], [-1, 1]]
    moves[0, base] = radius
    moves[1, base + 5] = 2 * radius / track
    whole = np.einsum("ij,jk,ik->i", moves, inertia, moves)
    drives = 2 * model.dof_armature[dofs].mean()
    return radius, track, whole / (2 * gains[0]), np.full(2, drives / (2 * gains[0]))


def _unfit(scene: Scene, expected: str) -> UserError:
    return UserError(
        f"robot '{scene.robot}' cannot drive in the kinematic simulator: expected "
        f"{expected}"
    )


@once_per_model
def _outlines(scene: Scene, solid: bool) -> tuple[np.ndarray, np.ndarray]:
    """Outlines of what rays see, or of what the shell can touch."""
    model, data = scene.model, at_rest(scene.model)
    mine = model.body_rootid[model.geom_bodyid] == model.body(ROBOT_BODY).id
    geoms = ~mine & (walls(model) if solid else static(model) & seen_by_rays(model))
    moving = np.flatnonzero(~mine & ~static(model)).tolist()
    if moving:
        name = model.geom(moving[0]).name or f"number {moving[0]}"
        raise _uncut(scene, name, "it moves")
    shell = model.geom(SHELL)
    low, high = data.geom_xpos[shell.id, 2] + shell.size[1] * np.array([-1, 1])
    if not solid:
        low = high = kinematics(scene, np.zeros((1, 3)))[2][0, 0, 2]
    found = Outlines()
    for geom in np.flatnonzero(geoms).tolist():
        try:
            add_outline(found, model, data, geom, float(low), float(high))
        except NoOutline as problem:
            name = model.geom(geom).name or f"number {geom}"
            raise _uncut(scene, name, str(problem)) from None
    segments = np.array(found.segments).reshape(-1, 4)
    segments[:, 2:] -= segments[:, :2]
    return segments, np.array(found.ellipses).reshape(-1, 6)


def _uncut(scene: Scene, name: str, why: str) -> UserError:
    return UserError(
        f"arena '{scene.arena}': geom '{name}' has no exact outline in a plan: {why}; "
        "--robot epuck simulates it"
    )


def _walls(segments: np.ndarray, ellipses: np.ndarray, reach: float) -> Walls:
    """Outlines with a grid whose cells know all that is within reach of them."""
    n, m = len(segments), len(ellipses)
    if reach > REACH_MAX:
        # everything is near: a grid of no cells
        nowhere = Grid(0.0, 0.0, 1.0, 0, 0)
        return Walls(
            nowhere, np.array([0, n + m]), np.arange(n + m), segments, ellipses
        )
    round_size = ellipses[:, 4:].max(axis=1, initial=0)[:, None]
    low = np.concatenate(
        [
            np.minimum(segments[:, :2], segments[:, :2] + segments[:, 2:]),
            ellipses[:, :2] - round_size,
        ]
    )
    high = np.concatenate(
        [
            np.maximum(segments[:, :2], segments[:, :2] + segments[:, 2:]),
            ellipses[:, :2] + round_size,
        ]
    )
    if n + m == 0:
        low = high = np.zeros((1, 2))
    # endless planes have no place
    finite = (np.abs(low) < 100).all(axis=1) & (np.abs(high) < 100).all(axis=1)
    box = low[finite], high[finite]
    origin = (box[0].min(axis=0) if finite.any() else np.full(2, -1.0)) - reach
    corner = (box[1].max(axis=0) if finite.any() else np.full(2, 1.0)) + reach
    size = corner - origin
    cell = max(CELL, float(np.sqrt(size.prod() / CELLS_MAX)))
    shape = np.ceil(size / cell).astype(np.int64)
    lists = [list[int]() for _ in range(int(shape.prod()))]
    for outline in range(n + m):
        first = np.clip(np.floor((low[outline] - reach - origin) / cell), 0, shape - 1)
        last = np.clip(np.floor((high[outline] + reach - origin) / cell), 0, shape - 1)
        cells = np.stack(
            np.meshgrid(
                np.arange(first[0], last[0] + 1),
                np.arange(first[1], last[1] + 1),
                indexing="ij",
            ),
            axis=-1,
        ).reshape(-1, 2)
        middles = origin + (cells + 0.5) * cell
        # half a diagonal more, for the corners
        near = _distance(segments, ellipses, outline, middles) <= reach + 0.7072 * cell
        for x, y in cells[near].astype(int).tolist():
            lists[x * int(shape[1]) + y].append(outline)
    # outside of the grid, everything may be near
    lists.append(list(range(n + m)))
    first = np.concatenate([[0], np.cumsum([len(found) for found in lists])])
    near = np.array([outline for found in lists for outline in found], np.int64)
    grid = Grid(float(origin[0]), float(origin[1]), cell, int(shape[0]), int(shape[1]))
    return Walls(grid, first.astype(np.int64), near, segments, ellipses)


def _distance(
    segments: np.ndarray, ellipses: np.ndarray, outline: int, points: np.ndarray
) -> np.ndarray:
    """Distance of points `(k, 2)` from an outline [m], or less."""
    if outline >= len(segments):
        middle, axes = np.split(ellipses[outline - len(segments)], [2])[0], ellipses
        return np.hypot(*(points - middle).T) - axes[outline - len(segments), 4:].max()
    start, way = np.split(segments[outline], 2)
    length = max(float(way @ way), np.finfo(float).tiny)
    share = np.clip((points - start) @ way / length, 0, 1)
    return np.hypot(*(points - start - share[:, None] * way).T)
