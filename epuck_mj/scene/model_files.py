"""The MJCF files of robots and arenas: shipped ones and the user's own."""

from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host.files import find, is_file

_HERE = Path(__file__).resolve().parent.parent

# beside the package in a checkout, inside it where the wheel is installed
MODELS = next(
    folder for folder in (_HERE / "models", _HERE.parent / "models") if folder.is_dir()
)

ROBOT_FILE = "epuck.xml"
"""MJCF of the shipped robot."""

KINEMATIC_ROBOT = "epuck_kinematic"
"""Name of the robot on wheels when it is simulated without MuJoCo's physics."""

WHEELED_ROBOT = "epuck"
"""Name of the robot on wheels in MuJoCo: every champion is reported on it."""


def absolute(name: str) -> str:
    """The name of a robot or arena; if it is a path to a file, the absolute path."""
    path = Path(name)
    shipped = {KINEMATIC_ROBOT, *(file.stem for file in MODELS.rglob("*.xml"))}
    return name if name in shipped or not is_file(path) else str(path.resolve())


def find_robot(name: str) -> Path:
    """The file of a shipped robot, or the user's own.

    Raises:
        UserError: if there is none, or its name would make it the kinematic robot.
    """
    if name != KINEMATIC_ROBOT and Path(name).stem == KINEMATIC_ROBOT:
        raise UserError(
            f"robot '{name}': expected another file name; '{KINEMATIC_ROBOT}' is the "
            "shipped robot that is simulated without MuJoCo"
        )
    # the same robot in two simulators
    shipped = MODELS / ROBOT_FILE
    by_name = {KINEMATIC_ROBOT: shipped, WHEELED_ROBOT: shipped}
    return find(name, "robot", by_name, "an MJCF").resolve()


def find_arena(name: str) -> Path:
    """The file of a shipped arena, or the user's own.

    Raises:
        UserError: if there is none.
    """
    arenas = [MODELS / "arena.xml", *sorted(MODELS.glob("arenas/*.xml"))]
    by_name = {path.stem: path for path in arenas}
    return find(name, "arena", by_name, "an MJCF").resolve()
