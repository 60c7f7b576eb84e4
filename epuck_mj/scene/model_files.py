"""The MJCF files of robots and arenas: shipped ones and the user's own."""

from collections.abc import Mapping
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host.files import find, is_file

_HERE = Path(__file__).resolve().parent.parent

# beside the package in a checkout, inside it where the wheel is installed
MODELS = next(
    folder for folder in (_HERE / "models", _HERE.parent / "models") if folder.is_dir()
)

KINEMATIC_ROBOT = "epuck_kinematic"
"""Name of the robot on wheels when it is simulated without MuJoCo's physics."""

WHEELED_ROBOT = "epuck"
"""Name of the robot on wheels in MuJoCo: champions are reported on it."""

ON_WHEELS: Mapping[str, str] = {
    KINEMATIC_ROBOT: WHEELED_ROBOT,
    "epuck_cone_kinematic": "epuck_cone",
}
"""The shipped robots: each without MuJoCo's physics, and the same robot on wheels.

Robots on wheels have an MJCF of their name.
"""

ROBOT_FILES: Mapping[str, str] = {
    name: f"{wheels}.xml"
    for kinematic, wheels in ON_WHEELS.items()
    for name in (kinematic, wheels)
}
"""MJCF of each shipped robot, by its name."""


def is_kinematic(robot: str) -> bool:
    """Whether a robot, given by name or path, is simulated without MuJoCo's physics."""
    return robot in ON_WHEELS


def is_on_wheels(robot: str) -> bool:
    """Whether it is a shipped robot on wheels."""
    return robot in ON_WHEELS.values()


def on_wheels(robot: str) -> str:
    """The shipped robot on wheels on which champions of a robot are reported.

    It is the robot itself, or the one that a kinematic robot climbs to; `epuck` for a
    robot of the user's own.
    """
    return ON_WHEELS.get(robot, robot if is_on_wheels(robot) else WHEELED_ROBOT)


def without_physics(robot: str) -> str:
    """The kinematic robot that is the same as `on_wheels(robot)`."""
    wheels = on_wheels(robot)
    return next(name for name, other in ON_WHEELS.items() if other == wheels)


def absolute(name: str) -> str:
    """The name of a robot or arena; if it is a path to a file, the absolute path."""
    path = Path(name)
    shipped = {*ON_WHEELS, *(file.stem for file in MODELS.rglob("*.xml"))}
    return name if name in shipped or not is_file(path) else str(path.resolve())


def find_robot(name: str) -> Path:
    """The file of a shipped robot, or the user's own.

    Raises:
        UserError: if there is none, or its name would make it a kinematic robot.
    """
    stem = Path(name).stem
    if name != stem and is_kinematic(stem):
        raise UserError(
            f"robot '{name}': expected another file name; '{stem}' is a shipped robot "
            "that is simulated without MuJoCo"
        )
    by_name = {shipped: MODELS / file for shipped, file in ROBOT_FILES.items()}
    return find(name, "robot", by_name, "an MJCF").resolve()


def find_arena(name: str) -> Path:
    """The file of a shipped arena, or the user's own.

    Raises:
        UserError: if there is none.
    """
    arenas = [MODELS / "arena.xml", *sorted(MODELS.glob("arenas/*.xml"))]
    by_name = {path.stem: path for path in arenas}
    return find(name, "arena", by_name, "an MJCF").resolve()
