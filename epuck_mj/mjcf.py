"""The MJCF of a scene as text: where it is, and an arena with its robot exchanged."""

import xml.etree.ElementTree as ET
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.files import find, is_file, read_text
from epuck_mj.interface import ROBOT_BODY

_HERE = Path(__file__).resolve().parent
# beside the package in a checkout, inside it where the wheel is installed
MODELS = next(
    folder for folder in (_HERE / "models", _HERE.parent / "models") if folder.is_dir()
)
SHIPPED_ROBOTS = ("epuck.xml", "epuck_planar.xml")
ADDED_ROBOT = "robot added to the arena.xml"


def absolute(name: str) -> str:
    """The name of a robot or arena; if it is a path, from the root on."""
    path = Path(name)
    shipped = {file.stem for file in MODELS.rglob("*.xml")}
    return name if name in shipped or not is_file(path) else str(path.resolve())


def find_robot(name: str) -> Path:
    """The file of a shipped robot, or the user's own.

    Raises:
        UserError: if there is none.
    """
    return _find(name, "robot", [MODELS / robot for robot in SHIPPED_ROBOTS])


def find_arena(name: str) -> Path:
    """The file of a shipped arena, or the user's own.

    Raises:
        UserError: if there is none.
    """
    arenas = [MODELS / "arena.xml", *sorted(MODELS.glob("arenas/*.xml"))]
    return _find(name, "arena", arenas)


def _find(name: str, kind: str, shipped: list[Path]) -> Path:
    """The file of a shipped model, or the user's own."""
    by_name = {path.stem: path for path in shipped}
    return find(name, kind, by_name, "an MJCF").resolve()


def with_robot(arena: Path, robot: Path) -> tuple[str, dict[str, bytes]]:
    """The arena's text and the files it includes, the robot among them replaced.

    Raises:
        UserError: if a file is missing or no XML, includes what MuJoCo would not find,
            or the arena is a robot itself.
    """
    text = read_text(arena)
    files, found = {}, False
    _refuse_includes(robot)
    for name in _includes(text, arena):
        path = arena.parent / name
        # a copied arena may name a robot that it left behind
        if path.name in SHIPPED_ROBOTS or _has_robot(read_text(path), path):
            found, path = True, robot
        _refuse_includes(path)
        files[name] = read_text(path).encode()
    if found:
        return text, files
    if _has_robot(text, arena):
        raise UserError(
            f"arena '{arena}' defines its own body '{ROBOT_BODY}': expected walls "
            "only, or a robot by <include>"
        )
    # walls only: the robot goes last, so line numbers stay
    files[ADDED_ROBOT] = read_text(robot).encode()
    head, _, tail = text.rpartition("</mujoco>")
    return f'{head}<include file="{ADDED_ROBOT}"/></mujoco>{tail}', files


def _parse(text: str, path: Path) -> ET.Element:
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise UserError(f"'{path}' is not well-formed XML: {error}") from None


def _includes(text: str, path: Path) -> list[str]:
    return [e.get("file", "") for e in _parse(text, path).iter("include")]


def _refuse_includes(path: Path) -> None:
    """Refuse a file to be included that includes others: nobody would hash those."""
    inner = _includes(read_text(path), path)
    if inner:
        raise UserError(
            f"'{path}' includes '{inner[0]}': an included file cannot include others, "
            "nor can a robot; expected it in the arena"
        )


def _has_robot(text: str, path: Path) -> bool:
    return _parse(text, path).find(f".//body[@name='{ROBOT_BODY}']") is not None
