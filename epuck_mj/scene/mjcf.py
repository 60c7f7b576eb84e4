"""Compiling MJCF: an arena with its robot exchanged."""

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco

from epuck_mj.errors import UserError
from epuck_mj.host.files import is_file, read_text
from epuck_mj.scene.model_files import SHIPPED_ROBOTS
from epuck_mj.scene.robot_parts import ROBOT_BODY, TIMESTEP

ADDED_ROBOT = "robot added to the arena.xml"


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


def compiled(arena: Path, robot: Path) -> tuple[mujoco.MjModel, dict[str, str]]:
    """The model of a robot in an arena, and the SHA-256 of each of its files.

    The hashes are called `arena`, `robot`, and by name for all other files.

    Raises:
        UserError: if a file is missing, or MuJoCo cannot compile it.
    """
    # compiled alone first: errors in an included file have no line number
    with _complaints(robot):
        mujoco.MjSpec.from_file(str(robot)).compile()
    scene = with_robot(arena, robot)
    with _complaints(arena):
        spec = mujoco.MjSpec.from_string(scene.text, include=dict(scene.files))
        assets = find_assets(spec, scene)
        # a robot that brings its converged step wants no other from the arena
        step = spec.numeric(TIMESTEP)
        if step is not None:
            spec.option.timestep = step.data[0]
        model = spec.compile()
    contents = {"arena": scene.text.encode()}
    for name, content in scene.files.items():
        contents["robot" if scene.paths[name] == robot else name] = content
    contents |= {name: path.read_bytes() for name, path in assets.items()}
    return model, {
        name: hashlib.sha256(content).hexdigest() for name, content in contents.items()
    }


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
    """Text of an included file, which may include none: those would not be hashed."""
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


@contextmanager
def _complaints(source: Path) -> Iterator[None]:
    """MuJoCo's errors about a file on one line."""
    try:
        yield
    except ValueError as error:
        message = " ".join(str(error).split())
        raise UserError(f"MuJoCo cannot compile '{source}': {message}") from None
