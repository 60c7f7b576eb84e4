"""Compiling MJCF: a robot attached to an arena.

The robot brings its physics: integrator, solver, step, gravity and flags are those of
its file, and what an arena says about them is not used, nor how its geoms touch things:
margins, gaps and priorities. The arena gives walls, floor and looks. The names of the
robot's parts begin with PREFIX in a scene.
"""

import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco

from epuck_mj.errors import UserError
from epuck_mj.scene.floor import lay_floor
from epuck_mj.scene.robot_parts import OWN_BODY, PREFIX, index_of
from epuck_mj.scene.sameness import check_same
from epuck_mj.scene.source_files import SourceFiles, defines_robot, source_files
from epuck_mj.scene.xml_elements import BadXml

WHOLE_MODEL = {
    "settotalmass": -1,
    "boundmass": 0,
    "boundinertia": 0,
    "balanceinertia": False,
    "discardvisual": False,
    "alignfree": False,
    "fusestatic": False,
}
"""Settings of an arena's compiler that would change the robot, and what they are."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """A robot in an arena.

    Attributes:
        model: the compiled model.
        sha256: of each file: `arena`, `robot`, and all others by path from the arena's
            folder or the robot's.
        arena: files of the arena.
        floor: indices of geoms whose collision bits were changed to make them a floor.
        height: of the floor that the robot stands on [m].
    """

    model: mujoco.MjModel
    sha256: Mapping[str, str]
    arena: SourceFiles
    floor: tuple[int, ...]
    height: float


def compiled(
    arena: Path, robot: Path, control_step: float, physics_step: float | None = None
) -> Compiled:
    """A robot in an arena, compiled.

    A robot that the arena includes is left out.

    Args:
        arena: path of the arena's MJCF.
        robot: path of the robot's MJCF.
        control_step: how long the robot's contact sensors remember touches [s].
        physics_step: in place of the robot's own [s], if not None.

    Raises:
        UserError: if a file is missing, MuJoCo cannot compile it, the arena is a robot
            itself, or it would change the robot.
    """
    robot_files, arena_files = (
        source_files(robot, robots_stay=True),
        source_files(arena),
    )
    own = defines_robot(arena_files.elements)
    if own is not None:
        raise BadXml.of(
            own,
            f"an arena cannot define a body '{OWN_BODY}' of its own: expected walls "
            "only, or a robot by <include>",
        )
    with _complaints(robot):
        alone = _robot(robot_files, control_step, physics_step).compile()
    index_of(alone, mujoco.mjtObj.mjOBJ_BODY, OWN_BODY, robot)
    with _complaints(arena):
        spec = _spec(arena_files)
        make_whole(spec)
        frame = _attach(spec, _robot(robot_files, control_step, physics_step))
        model, floor, height = lay_floor(spec, frame)
    if model.nflex:
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX.value, 0)
        raise UserError(
            f"arena '{arena}' has a flex, '{name}': expected walls that are geoms and "
            "stand still"
        )
    alone.body_pos[alone.body(OWN_BODY).id, 2] += height
    check_same(model, alone, arena)
    hashes = _hashes(robot_files, "robot") | _hashes(arena_files, "arena")
    sha256 = {name: hashes.pop(name) for name in ("arena", "robot")} | hashes
    for files in (arena_files, robot_files):
        for element in files.missing:
            raise BadXml.of(
                element, "its file was not found, so a change in it would go unnoticed"
            )
    return Compiled(model, sha256, arena_files, floor, height)


def make_whole(arena: mujoco.MjSpec) -> None:
    """Undo an arena's settings of WHOLE_MODEL, and make one body of all that is still.

    With a body for every wall, mazes are ten times as slow.
    """
    for name, value in WHOLE_MODEL.items():
        setattr(arena.compiler, name, value)
    if len(arena.bodies) > 1:
        arena.compiler.fusestatic = True
        arena.compile()
        arena.compiler.fusestatic = False


def _spec(files: SourceFiles) -> mujoco.MjSpec:
    # from the texts that were hashed, not from the files again
    return mujoco.MjSpec.from_file(
        str(files.main), include={str(path): text for path, text in files.xml.items()}
    )


def _robot(
    files: SourceFiles, control_step: float, physics_step: float | None
) -> mujoco.MjSpec:
    """A robot whose contact sensors remember the physics steps of a control step.

    And whose rays remember their last value, so that they need not be new in each.
    """
    spec = _spec(files)
    spec.option.timestep = physics_step or spec.option.timestep
    for sensor in spec.sensors:
        if sensor.type == mujoco.mjtSensor.mjSENS_RANGEFINDER:
            sensor.nsample = 1
        elif sensor.type == mujoco.mjtSensor.mjSENS_CONTACT and spec.option.timestep:
            sensor.nsample = max(1, round(control_step / spec.option.timestep))
    return spec


def _attach(arena: mujoco.MjSpec, robot: mujoco.MjSpec) -> mujoco.MjsFrame:
    """Put a robot into an arena, and its physics in place of the arena's.

    Returns:
        The frame that it is in.
    """
    for spec in (arena, robot):
        # of other sizes than the scene
        for key in list(spec.keys):
            spec.delete(key)
    arena.option = robot.option
    for geom in arena.geoms:
        # robots crash when they touch something, and their wheels' friction counts
        geom.margin = geom.gap = geom.priority = 0
    # MuJoCo's own choice is a hundred times what a robot among walls needs
    own_choice = len(arena.bodies) > 1
    arena.memory = robot.memory = -1 if own_choice else robot.memory
    frame = arena.worldbody.add_frame()
    arena.attach(robot, prefix=PREFIX, frame=frame)
    return frame


def _hashes(files: SourceFiles, name: str) -> dict[str, str]:
    return {
        name
        if path == files.main
        else Path(os.path.relpath(path, files.main.parent)).as_posix(): digest
        for path, digest in files.sha256().items()
    }


@contextmanager
def _complaints(source: Path) -> Iterator[None]:
    """MuJoCo's errors about a file on one line."""
    try:
        with warnings.catch_warnings():
            # of attributes that will go; ours are not among them
            warnings.simplefilter("ignore", UserWarning)
            yield
    except (ValueError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        message = " ".join(str(error).split())
        raise UserError(f"MuJoCo cannot compile '{source}': {message}") from None
