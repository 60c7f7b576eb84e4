"""A picture of a controller's trial in 3D: `python -m epuck_mj.render champion.json`.

Drawn by MuJoCo without a window, with EGL or OSMesa. The package switches MuJoCo's own
choice between them off, so the context is made here and nowhere else.
"""

import copy
import importlib
import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes.util import find_library
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import tyro
from matplotlib.image import imsave

from epuck_mj.colors import HIGH_FITNESS, LOW_FITNESS, blend
from epuck_mj.command_line import main, parse
from epuck_mj.control import TaskParameters
from epuck_mj.controller import load
from epuck_mj.errors import UserError
from epuck_mj.files import write_bytes
from epuck_mj.geometry import arena_box, drawn
from epuck_mj.model import Scene, load_scene
from epuck_mj.starts import FreeSpace
from epuck_mj.tasks import START_CLEARANCE
from epuck_mj.trajectory import Trajectory, record

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
"""OpenGL without a window, by MuJoCo's name for it, in the order tried."""

PATH_HEIGHT = 0.003
"""Of the path above the floor [m]."""

PATH_RADIUS = 0.004
"""Of the path as drawn [m]."""

ELEVATION = -60.0
"""Of the camera's line of sight [degrees]."""

CAMERA_DISTANCE = 1.05
"""Of the camera from the arena's middle, in diagonals of the arena."""


@dataclass(frozen=True)
class Options:
    """Draw a controller's trial in 3D: the arena, the path, the robot at its end."""

    champion: tyro.conf.Positional[Path]
    """controller file (JSON)"""
    output: Path
    """picture to write (PNG)"""
    robot: str = "epuck"
    """name of a shipped robot, or path of an MJCF"""
    arena: str | None = None
    """name of a shipped arena, or path of an MJCF; the controller's own by default"""
    width: int = 1200
    """of the picture [pixels]"""
    height: int = 800
    """of the picture [pixels]"""
    seconds: float = 30.0
    """duration of the trial [s]"""
    seed: int = 0
    """of the start"""


def render(scene: Scene, trajectory: Trajectory, width: int, height: int) -> np.ndarray:
    """The arena with the path on its floor and the robot where it ended.

    Args:
        scene: where the trajectory was recorded.
        trajectory: what happened.
        width: of the picture [pixels].
        height: of the picture [pixels].

    Returns:
        Picture `(height, width, 3)`, 0 to 255.

    Raises:
        UserError: if no OpenGL is there.
    """
    # the copy is for looking at only
    model = copy.copy(scene.model)
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.geom_group[:] = np.where(drawn(model), 0, mujoco.mjNGROUP - 1)
    if not model.nlight:
        # the headlight's own share is meant to go with lights
        model.vis.headlight.ambient[:] = 0.6
        model.vis.headlight.diffuse[:] = 0.6
    data = mujoco.MjData(model)
    data.qpos[:] = scene.qpos(trajectory.pose[-1])
    mujoco.mj_forward(model, data)
    options = mujoco.MjvOption()
    options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False

    with opengl(width, height):
        view = mujoco.MjvScene(model, model.ngeom + trajectory.steps + 100)
        mujoco.mjv_updateScene(
            model,
            data,
            options,
            None,
            _camera(model),
            mujoco.mjtCatBit.mjCAT_ALL.value,
            view,
        )
        _add_path(view, trajectory)
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
        frame = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(frame, view, context)
        picture = np.zeros((height, width, 3), np.uint8)
        depth = np.zeros((height, width), np.float32)
        mujoco.mjr_readPixels(picture, depth, frame, context)
        context.free()
    # white, as paper, behind an arena without a sky
    picture[depth == 1] = 255
    # OpenGL counts rows from below
    return picture[::-1]


@contextmanager
def opengl(width: int, height: int) -> Iterator[None]:
    """OpenGL without a window, current while the context lasts.

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
        yield
    finally:
        context.free()


def _camera(model: mujoco.MjModel) -> mujoco.MjvCamera:
    """A camera that sees the whole arena."""
    lower, upper = arena_box(model)
    camera = mujoco.MjvCamera()
    # what is near looks larger: a little to the front of the middle
    camera.lookat[:] = (lower + upper) / 2 - [0, 0.05 * (upper - lower)[1], 0]
    camera.azimuth, camera.elevation = 90.0, ELEVATION
    camera.distance = np.linalg.norm(upper - lower) * CAMERA_DISTANCE
    return camera


def _add_path(view: mujoco.MjvScene, trajectory: Trajectory) -> None:
    """One capsule per control step, coloured by step fitness."""
    points = np.full((trajectory.steps + 1, 3), PATH_HEIGHT)
    points[:, :2] = trajectory.pose[:, :2]
    colors = blend(LOW_FITNESS, HIGH_FITNESS, trajectory.fitness) / 255
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE.value
    for start, end, color in zip(points[:-1], points[1:], colors, strict=True):
        geom = view.geoms[view.ngeom]
        rgba = np.array([*color, 1], np.float32)
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), rgba)
        mujoco.mjv_connector(geom, kind, PATH_RADIUS, start, end)
        view.ngeom += 1


def run(argv: Sequence[str]) -> int:
    """Draw and write the picture; the exit status.

    Raises:
        UserError: for anything a user can put right.
    """
    options = parse(Options, "python -m epuck_mj.render", argv)
    file = load(options.champion)
    task = TaskParameters.from_dict(file.task)
    steps = round(options.seconds / task.control_step)
    for name, value in (
        ("width", options.width),
        ("height", options.height),
        ("seconds, in control steps,", steps),
    ):
        if value < 1:
            raise UserError(f"expected --{name} of at least 1, got {value}")
    arena = options.arena or str(file.scene.get("arena", "arena"))
    scene = load_scene(options.robot, arena, task.control_step)
    space = FreeSpace(scene, START_CLEARANCE)
    start = space.sample(np.random.default_rng(options.seed), 1)[0]
    trajectory = record(scene, file.controller, start, replace(task, steps=steps))
    picture = io.BytesIO()
    pixels = render(scene, trajectory, options.width, options.height)
    imsave(picture, pixels, format="png", metadata={"Software": "epuck_mj"})
    try:
        write_bytes(options.output, picture.getvalue())
    except OSError as error:
        raise UserError(f"cannot write '{options.output}': {error.strerror}") from None
    print(
        f"{options.output}: fitness {trajectory.trial_fitness:.1f} of {steps}"
        + (f", crash after {trajectory.steps} steps" if trajectory.crashed else "")
    )
    return 0


if __name__ == "__main__":
    main(run)
