"""The MJCF of a scene as text: where it is, and an arena with its robot exchanged."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco

from epuck_mj.errors import UserError
from epuck_mj.host.files import find, is_file, read_text
from epuck_mj.scene.robot_parts import ROBOT_BODY

_HERE = Path(__file__).resolve().parent.parent
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


@dataclass(frozen=True)
class SceneText:
    """An arena with its robot exchanged, not yet compiled.

    Attributes:
        text: of the arena.
        files: what it includes, by the name it includes it by.
        paths: where each of these is from.
        arena: where the text is from.
        robot: where the robot is from, which one of the files is.
    """

    text: str
    files: Mapping[str, bytes]
    paths: Mapping[str, Path]
    arena: Path
    robot: Path


def with_robot(arena: Path, robot: Path) -> SceneText:
    """The arena's text and the files it includes, the robot among them replaced.

    Raises:
        UserError: if a file is missing or no XML, includes what MuJoCo would not find,
            or the arena is a robot itself.
    """
    text, robot_text = read_text(arena), _included(robot)
    paths = {}
    for name in _includes(text, arena):
        path = arena.parent / name
        # a copied arena may name a robot that it left behind
        if path.name in SHIPPED_ROBOTS or _has_robot(read_text(path), path):
            path = robot
        paths[name] = path
    if robot not in paths.values():
        if _has_robot(text, arena):
            raise UserError(
                f"arena '{arena}' defines its own body '{ROBOT_BODY}': expected walls "
                "only, or a robot by <include>"
            )
        # walls only: the robot goes last, so line numbers stay
        paths[ADDED_ROBOT] = robot
        head, _, tail = text.rpartition("</mujoco>")
        text = f'{head}<include file="{ADDED_ROBOT}"/></mujoco>{tail}'
    files = {
        name: (robot_text if path == robot else _included(path)).encode()
        for name, path in paths.items()
    }
    return SceneText(text, files, paths, arena, robot)


def find_assets(spec: mujoco.MjSpec, scene: SceneText) -> dict[str, Path]:
    """The files of meshes, textures and height fields by name, as far as they exist.

    They are looked for beside the arena, then beside the robot; the spec is told where.
    """
    found = {}
    spec.modelfiledir = str(scene.arena.parent)
    # MuJoCo puts it before the names of files that the robot names
    include = next(name for name, path in scene.paths.items() if path == scene.robot)
    prefix = Path(include).parent
    for parts, folder in (
        (spec.meshes, spec.meshdir),
        (spec.textures, spec.texturedir),
        (spec.hfields, spec.meshdir),
    ):
        for part in parts:
            name = Path(part.file)
            own = name.relative_to(prefix) if name.is_relative_to(prefix) else name
            places = (
                scene.arena.parent / folder / name,
                scene.robot.parent / folder / own,
            )
            path = next((path for path in places if part.file and is_file(path)), None)
            if path is not None:
                found[own.as_posix()] = path
                part.file = str(path)
    return found


def _parse(text: str, path: Path) -> ET.Element:
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise UserError(f"'{path}' is not well-formed XML: {error}") from None


def _includes(text: str, path: Path) -> list[str]:
    return [e.get("file", "") for e in _parse(text, path).iter("include")]


def _included(path: Path) -> str:
    """The text of a file that is included; it includes none: nobody would hash it."""
    text = read_text(path)
    inner = _includes(text, path)
    if inner:
        raise UserError(
            f"'{path}' includes '{inner[0]}': an included file cannot include others, "
            "nor can a robot; expected it in the arena"
        )
    return text


def _has_robot(text: str, path: Path) -> bool:
    return _parse(text, path).find(f".//body[@name='{ROBOT_BODY}']") is not None
