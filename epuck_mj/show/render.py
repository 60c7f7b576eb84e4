"""Pictures in 3D, drawn by MuJoCo with EGL or OSMesa, without a window.

The context of OpenGL is made here, whatever MuJoCo itself would choose.
"""

import copy
import importlib
import itertools
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes.util import find_library
from typing import Any

import mujoco
import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.geometry import arena_box, drawn
from epuck_mj.scene.model import Scene
from epuck_mj.show.colors import HIGH_FITNESS, LOW_FITNESS, TRIALS, blend
from epuck_mj.show.rays import ray_lines
from epuck_mj.trials.trajectory import Trajectory

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
"""Libraries for OpenGL without a window, by MuJoCo's names, in the order tried."""

PATH_HEIGHT = 0.003
"""Height of the path above the floor [m]."""

PATH_RADIUS = 0.004
"""Radius of the path as drawn [m]."""

ELEVATION = -72.0
"""Elevation of the camera's line of sight [degrees]."""

MARK_HEIGHT, MARK_RADIUS = 0.07, 0.012
"""Height and radius of the coloured ball above a robot [m]."""

DRAFT_SHADOWS = 1024
"""Size of a draft's shadow map [pixels]."""

CAMERA_MARGIN = 1.04
"""Size of what a picture shows, in sizes of the box around the arena."""

CLOSE_DISTANCE, CLOSE_ELEVATION = 0.24, -50.0
"""Distance of a close-up's camera from the robot [m], and its elevation [degrees]."""

AGAINST = 2.0
"""How much a close-up's camera looks against the heading, in shares of outwards."""

RAY_RADIUS = 0.0012
"""Radius of a sensor's ray as drawn [m]."""

_CATEGORY = mujoco.mjtCatBit


class Painter:
    """Painter of trials in an arena at any time; made by `painter`."""

    def __init__(
        self,
        scene: Scene,
        trajectories: Sequence[Trajectory],
        width: int,
        height: int,
        draft: bool,
        gl: Any,
    ):
        """Set up the scene in a context `gl` of OpenGL, which has to be current."""
        self._gl = gl
        # the copy is for looking at only
        model = copy.copy(scene.model)
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        if draft:
            model.vis.quality.shadowsize = DRAFT_SHADOWS
            model.vis.quality.offsamples = 0
        model.geom_group[:] = np.where(drawn(model), 0, mujoco.mjNGROUP - 1)
        if not model.nlight:
            # the headlight's own share is meant to go with lights
            model.vis.headlight.ambient[:] = 0.6
            model.vis.headlight.diffuse[:] = 0.6
        self._scene, self._model, self._data = scene, model, mujoco.MjData(model)
        self._trajectories = trajectories
        self._options = mujoco.MjvOption()
        self._options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
        steps = sum(trajectory.steps + 1 for trajectory in trajectories)
        most = (model.ngeom + 1) * len(trajectories) + steps + 100
        self._view = mujoco.MjvScene(model, most)
        self._camera = _camera(model, width / height)
        scale = mujoco.mjtFontScale.mjFONTSCALE_100.value
        self._context = mujoco.MjrContext(model, scale)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._frame = mujoco.MjrRect(0, 0, width, height)

    def picture(self, time: float = np.inf) -> np.ndarray:
        """The arena with the paths up to `time` [s] and the robots at their ends.

        Returns:
            Picture `(height, width, 3)`, 0 to 255.
        """
        self._compose(time)
        return self._pixels()

    def close_up(self, sensor_range: float) -> np.ndarray:
        """The first robot at the end of its trial with its rays, seen from inside.

        Args:
            sensor_range: where a ray ends that hits nothing [m].

        Returns:
            Picture `(height, width, 3)`, 0 to 255.
        """
        trajectory, whole = self._trajectories[0], self._camera
        self._camera = _close_camera(self._model, trajectory.pose[-1])
        try:
            self._compose(np.inf)
        finally:
            self._camera = whole
        lines, colors = ray_lines(self._scene, trajectory, sensor_range)
        _add_lines(self._view, lines[-1], colors[-1], RAY_RADIUS)
        return self._pixels()

    def _compose(self, time: float) -> None:
        """Put everything that is to be seen at a time into the view."""
        # another painter may have drawn since
        self._gl.make_current()
        for i, trajectory in enumerate(self._trajectories):
            pose = _pose_at(trajectory, time)
            self._data.qpos[:] = self._scene.qpos(pose)
            mujoco.mj_forward(self._model, self._data)
            if i == 0:
                self._update()
            else:
                self._add_robot()
            _add_path(self._view, trajectory, time, pose)
            if len(self._trajectories) > 1:
                _add_mark(self._view, pose, i)

    def _pixels(self) -> np.ndarray:
        """The view as a picture `(height, width, 3)`, 0 to 255."""
        mujoco.mjr_render(self._frame, self._view, self._context)
        width, height = self._frame.width, self._frame.height
        picture = np.zeros((height, width, 3), np.uint8)
        depth = np.zeros((height, width), np.float32)
        mujoco.mjr_readPixels(picture, depth, self._frame, self._context)
        # white, as paper, behind an arena without a sky
        picture[depth == 1] = 255
        # OpenGL counts rows from below
        return picture[::-1]

    def _update(self) -> None:
        """Begin a view: the arena and the first robot."""
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            self._options,
            None,
            self._camera,
            _CATEGORY.mjCAT_ALL.value,
            self._view,
        )

    def _add_robot(self) -> None:
        """Add one more robot, which is drawn but not simulated."""
        mujoco.mjv_addGeoms(
            self._model,
            self._data,
            self._options,
            mujoco.MjvPerturb(),
            _CATEGORY.mjCAT_DYNAMIC.value,
            self._view,
        )

    def free(self) -> None:
        """Free OpenGL's memory."""
        self._gl.make_current()
        self._context.free()


@contextmanager
def painter(
    scene: Scene,
    trajectories: Sequence[Trajectory],
    width: int,
    height: int,
    draft: bool = False,
) -> Iterator[Painter]:
    """Make a painter of trials for the block.

    Args:
        scene: where the trajectories were recorded.
        trajectories: what happened, at least one.
        width: of the pictures [pixels].
        height: of the pictures [pixels].
        draft: coarser shadows and edges, in a third of the time.

    Raises:
        UserError: if no OpenGL is there.
    """
    with opengl(width, height) as gl:
        artist = Painter(scene, trajectories, width, height, draft, gl)
        try:
            yield artist
        finally:
            artist.free()


@contextmanager
def opengl(width: int, height: int) -> Iterator[Any]:
    """Make a context of OpenGL without a window, current at the block's beginning.

    Raises:
        UserError: if there is none.
    """
    name = os.environ.get("MUJOCO_GL", "")
    if name not in LIBRARIES:
        there = [key for key, library in LIBRARIES.items() if find_library(library)]
        if not there:
            raise UserError(
                "no OpenGL to draw with: expected the library of EGL or OSMesa "
                "(Debian: apt-get install libegl1 or libosmesa6)"
            )
        name = there[0]
    try:
        context = importlib.import_module(f"mujoco.{name}").GLContext(width, height)
        context.make_current()
    except Exception as error:  # whatever PyOpenGL and drivers come up with
        reason = " ".join(str(error).split())
        other = next(key for key in LIBRARIES if key != name)
        raise UserError(
            f"cannot draw with MUJOCO_GL={name} ({reason}): expected a working "
            f"{LIBRARIES[name]}, or MUJOCO_GL={other}"
        ) from None
    try:
        yield context
    finally:
        context.free()


def _camera(model: mujoco.MjModel, aspect: float) -> mujoco.MjvCamera:
    """Make a camera that sees the box around the walls, and no more than it has to.

    Args:
        model: of arena and robot.
        aspect: width of the picture by its height.
    """
    lower, upper = arena_box(model)
    middle, half = (lower + upper) / 2, CAMERA_MARGIN * (upper - lower) / 2
    corners = half * np.array(list(itertools.product((-1, 1), repeat=3)))
    level, down = np.cos(np.radians(ELEVATION)), np.sin(np.radians(ELEVATION))
    # in the camera's frame: to the right, up, and away from it
    axes = [[1, 0, 0], [0, -down, level], [0, level, down]]
    right, up, away = (corners @ np.transpose(axes)).T
    height = np.tan(np.radians(model.vis.global_.fovy) / 2)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = middle
    camera.azimuth, camera.elevation = 90.0, ELEVATION
    camera.distance = max(
        np.max(np.abs(right) / (height * aspect) - away),
        np.max(np.abs(up) / height - away),
    )
    return camera


def _close_camera(model: mujoco.MjModel, pose: np.ndarray) -> mujoco.MjvCamera:
    """Make a camera near a robot that sees its front and what is outwards, a wall."""
    lower, upper = arena_box(model)
    outwards = pose[:2] - ((lower + upper) / 2)[:2]
    ahead = np.array([np.cos(pose[2]), np.sin(pose[2])])
    # a robot in the very middle has no outwards
    sight = outwards / max(np.linalg.norm(outwards), 1e-9) - AGAINST * ahead
    camera = mujoco.MjvCamera()
    camera.lookat[:] = *pose[:2], 0.0
    camera.azimuth = np.degrees(np.arctan2(sight[1], sight[0]))
    camera.elevation, camera.distance = CLOSE_ELEVATION, CLOSE_DISTANCE
    return camera


def _pose_at(trajectory: Trajectory, time: float) -> np.ndarray:
    """Pose `(3,)` at a time [s], interpolated; after the end the last pose."""
    x, y, yaw = trajectory.pose.T
    columns = (x, y, np.unwrap(yaw))
    return np.array([np.interp(time, trajectory.time, column) for column in columns])


def _add_path(
    view: mujoco.MjvScene, trajectory: Trajectory, time: float, pose: np.ndarray
) -> None:
    """Draw one capsule per control step so far, coloured by step fitness."""
    steps = int(np.searchsorted(trajectory.time[1:], time))
    points = np.full((min(steps + 1, trajectory.steps) + 1, 3), PATH_HEIGHT)
    points[:, :2] = trajectory.pose[: len(points), :2]
    # the step that is going on ends where the robot is
    points[-1, :2] = pose[:2]
    colors = blend(LOW_FITNESS, HIGH_FITNESS, trajectory.fitness)
    lines = np.stack([points[:-1], points[1:]], axis=1)
    _add_lines(view, lines, colors, PATH_RADIUS)


def _add_lines(
    view: mujoco.MjvScene, lines: np.ndarray, colors: np.ndarray, radius: float
) -> None:
    """Draw lines `(n, 2, 3)` [m] as capsules in at least `n` colours, 0 to 255."""
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE.value
    for (start, end), color in zip(lines, colors / 255, strict=False):
        geom = view.geoms[view.ngeom]
        rgba = np.array([*color, 1], np.float32)
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), rgba)
        mujoco.mjv_connector(geom, kind, radius, start, end)
        view.ngeom += 1


def _add_mark(view: mujoco.MjvScene, pose: np.ndarray, trial: int) -> None:
    """Draw a ball above the robot in the colour of its trial."""
    rgba = np.array([*np.array(TRIALS[trial % len(TRIALS)]) / 255, 1], np.float32)
    mujoco.mjv_initGeom(
        view.geoms[view.ngeom],
        mujoco.mjtGeom.mjGEOM_SPHERE.value,
        np.full(3, MARK_RADIUS),
        np.array([*pose[:2], MARK_HEIGHT]),
        np.eye(3).ravel(),
        rgba,
    )
    view.ngeom += 1
