"""Pictures in 3D, drawn by MuJoCo with EGL or OSMesa, without a window.

The context of OpenGL is made here, whatever MuJoCo itself would choose.
"""

import copy
import importlib
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
from epuck_mj.trials.trajectory import Trajectory

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
"""Libraries for OpenGL without a window, by MuJoCo's names, in the order tried."""

PATH_HEIGHT = 0.003
"""Height of the path above the floor [m]."""

PATH_RADIUS = 0.004
"""Radius of the path as drawn [m]."""

ELEVATION = -60.0
"""Elevation of the camera's line of sight [degrees]."""

MARK_HEIGHT, MARK_RADIUS = 0.07, 0.012
"""Height and radius of the coloured ball above a robot [m]."""

DRAFT_SHADOWS = 1024
"""Size of a draft's shadow map [pixels]."""

CAMERA_DISTANCE = 1.05
"""Distance of the camera from the arena's middle, in diagonals of the arena."""

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
        self._camera = _camera(model)
        scale = mujoco.mjtFontScale.mjFONTSCALE_100.value
        self._context = mujoco.MjrContext(model, scale)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._frame = mujoco.MjrRect(0, 0, width, height)

    def picture(self, time: float = np.inf) -> np.ndarray:
        """The arena with the paths up to `time` [s] and the robots at their ends.

        Returns:
            Picture `(height, width, 3)`, 0 to 255.
        """
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


def _camera(model: mujoco.MjModel) -> mujoco.MjvCamera:
    """Make a camera that sees the whole arena."""
    lower, upper = arena_box(model)
    camera = mujoco.MjvCamera()
    # what is near looks larger: a little to the front of the middle
    camera.lookat[:] = (lower + upper) / 2 - [0, 0.05 * (upper - lower)[1], 0]
    camera.azimuth, camera.elevation = 90.0, ELEVATION
    camera.distance = np.linalg.norm(upper - lower) * CAMERA_DISTANCE
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
    colors = blend(LOW_FITNESS, HIGH_FITNESS, trajectory.fitness) / 255
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE.value
    for start, end, color in zip(points[:-1], points[1:], colors, strict=False):
        geom = view.geoms[view.ngeom]
        rgba = np.array([*color, 1], np.float32)
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), rgba)
        mujoco.mjv_connector(geom, kind, PATH_RADIUS, start, end)
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
