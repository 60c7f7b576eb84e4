"""Source of a scene: the XML of arena, includes and robot as one text.

MuJoCo names the line of an element, but not for files that are included. So elements
are written into a single text, one a line, and a table says where each came from.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import mujoco

from epuck_mj.check.findings import Place, Unusable, error
from epuck_mj.errors import UserError
from epuck_mj.host.files import is_file, read_text
from epuck_mj.scene.mjcf import SceneText, find_assets, with_robot
from epuck_mj.scene.model_files import SHIPPED_ROBOTS
from epuck_mj.scene.robot_parts import ROBOT_BODY

TOPIC = "file"


@dataclass(frozen=True)
class Element:
    """One element of the XML."""

    tag: str
    attributes: Mapping[str, str]
    place: Place


@dataclass(frozen=True)
class Source:
    """A scene as one text; element `i` stands on line `i + 1`."""

    text: str
    elements: tuple[Element, ...]
    scene: SceneText

    def setting(self, tag: str, attribute: str) -> Place:
        """Where the last element of a kind sets an attribute, or the arena's file."""
        places = [
            element.place
            for element in self.elements
            if element.tag == tag and attribute in element.attributes
        ]
        return places[-1] if places else Place(self.scene.arena)


def read(arena: Path, robot: Path) -> Source:
    """An arena's elements, with those of the robot that is put into it.

    Raises:
        Unusable: if the arena is not well-formed, or a file it includes is not there.
        UserError: if the arena cannot be read at all.
    """
    alone = _Text()
    alone.add(read_text(arena).encode(), arena)
    names = set()
    for element in alone.elements:
        if element.tag == "include":
            name = _included(element, arena)
            if name in names:
                raise Unusable(
                    error(TOPIC, f"'{name}' is already included", element.place)
                )
            names.add(name)
            # a copied arena may name a robot that it left behind
            if Path(name).name not in SHIPPED_ROBOTS:
                _refuse_nested(arena.parent / name)
    own = [e for e in alone.elements if e.attributes.get("name") == ROBOT_BODY]
    try:
        scene = with_robot(arena, robot)
    except UserError as problem:
        place = next((e.place for e in own if e.tag == "body"), Place(arena))
        raise Unusable(error(TOPIC, str(problem), place)) from None
    whole = _Text(scene.paths, scene.files)
    try:
        whole.add(scene.text.encode(), arena)
    except Unusable:
        end = "expected the file to end with </mujoco>, where the robot is put"
        raise Unusable(error(TOPIC, end, Place(arena))) from None
    return Source("\n".join(whole.lines), tuple(whole.elements), scene)


def compiled_source(source: Source) -> tuple[mujoco.MjModel, tuple[Place, ...]]:
    """The scene's model, and where each of its geoms was written.

    Raises:
        Unusable: if MuJoCo refuses, with the line that it names.
    """
    try:
        spec = mujoco.MjSpec.from_string(source.text)
        find_assets(spec, source.scene)
        model = spec.compile()
    except (ValueError, mujoco.FatalError, mujoco.UnexpectedError) as problem:
        message = " ".join(str(problem).split())
        # what MuJoCo says of the place, we say better
        text = re.split(r" ?\bElement (?:name )?'", message)[0]
        text = re.sub(r"^(XML )?(Error: )+", "", text)
        place = _place(source, message)
        raise Unusable(error(TOPIC, f"MuJoCo: {text}", place)) from None
    geoms = {geom.id: _place(source, geom.info) for geom in spec.geoms}
    return model, tuple(geoms[i] for i in range(model.ngeom))


def _place(source: Source, said: str) -> Place:
    """The element on the line that a text of MuJoCo's names, else the whole arena."""
    named = re.search(r"\bline (\d+)", said)
    line = int(named[1]) if named else 0
    if 1 <= line <= len(source.elements):
        return source.elements[line - 1].place
    # of files that cannot be opened, it says the name only
    for element in source.elements:
        if f"'{element.attributes.get('file')}'" in said:
            return element.place
    return Place(source.scene.arena)


@dataclass
class _Text:
    """Collects elements, those of included files in the place of the include."""

    paths: Mapping[str, Path] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    elements: list[Element] = field(default_factory=list)

    def add(self, content: bytes, path: Path, depth: int = 0) -> None:
        """Add a file's elements; of an included one, those within its root."""
        parser = expat.ParserCreate("utf-8")
        # of the elements that are open: whether they were added
        added: list[bool] = []

        def start(tag: str, attributes: dict[str, str]) -> None:
            included = attributes.get("file", "")
            replaced = tag == "include" and included in self.files
            if replaced:
                file = self.files[included]
                self.add(file, self.paths[included], depth + 1)
            added.append(not replaced and (depth == 0 or bool(added)))
            if added[-1]:
                place = Place(path, parser.CurrentLineNumber, _shown(tag, attributes))
                self.elements.append(Element(tag, attributes, place))
                fields = (f" {name}={quoteattr(v)}" for name, v in attributes.items())
                self.lines.append(f"<{tag}{''.join(fields)}>")

        def end(tag: str) -> None:
            if added.pop():
                self.lines[-1] += f"</{tag}>"

        parser.StartElementHandler, parser.EndElementHandler = start, end
        try:
            parser.Parse(content, True)
        except expat.ExpatError as problem:
            text = f"not well-formed XML: {expat.ErrorString(problem.code)}"
            raise Unusable(error(TOPIC, text, Place(path, problem.lineno))) from None


def _shown(tag: str, attributes: Mapping[str, str]) -> str:
    """An element's tag with its name or other attribute."""
    for key in ("name", "file", "class"):
        if key in attributes:
            return f'<{tag} {key}="{attributes[key]}">'
    return f"<{tag}>"


def _included(element: Element, arena: Path) -> str:
    """Name of the file that an include names.

    Raises:
        Unusable: if there is no such file.
    """
    name = element.attributes.get("file", "")
    path = arena.parent / name
    if path.name not in SHIPPED_ROBOTS and not is_file(path):
        text = f"no file '{path}' to include"
        raise Unusable(error(TOPIC, text, element.place))
    return name


def _refuse_nested(path: Path) -> None:
    inner = _Text()
    inner.add(read_text(path).encode(), path)
    for element in inner.elements:
        if element.tag == "include":
            text = "an included file cannot include others; expected it in the arena"
            raise Unusable(error(TOPIC, text, element.place))
