"""Places of an arena's geoms and bodies in its XML files.

MuJoCo names the line of an element, but not in files that are included. So elements are
written into a single text, one a line, below lines that no attached model reaches.
"""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco

from epuck_mj.check.findings import Finding, Place, Unusable, error, names
from epuck_mj.scene.mjcf import WHOLE_MODEL, make_whole
from epuck_mj.scene.source_files import SourceFiles, named_files, source_files
from epuck_mj.scene.xml_elements import ELEMENTS_MAX, BadXml, Element

TOPIC = "file"

REFUSALS = (ValueError, mujoco.FatalError, mujoco.UnexpectedError)
"""What MuJoCo raises for a model that it cannot compile."""


def read(arena: Path) -> SourceFiles:
    """The files of an arena.

    Raises:
        Unusable: if one is not well-formed, or a file that it includes is not there.
        UserError: if the arena cannot be read at all.
    """
    try:
        return source_files(arena)
    except BadXml as problem:
        raise Unusable(error(TOPIC, problem.problem, place_of(problem))) from None


def place_of(problem: BadXml) -> Place:
    """Where an XML is wrong."""
    if problem.element is None:
        return Place(problem.file, problem.line)
    return _place_of(problem.element)


@dataclass(frozen=True)
class Places:
    """Where an arena's geoms and bodies were written, in the model's order.

    What a robot brings comes behind them, and was not written in the arena.
    """

    geoms: tuple[Place, ...]
    bodies: tuple[Place, ...]
    main: Place

    def geom(self, geom: int) -> Place:
        """Place of a geom by its index in the model."""
        return self.geoms[geom] if geom < len(self.geoms) else self.main

    def body(self, body: int) -> Place:
        """Place of a body by its index in the model."""
        return self.bodies[body] if body < len(self.bodies) else self.main


def places_of(files: SourceFiles) -> Places:
    """The places of an arena's parts.

    Raises:
        Unusable: if MuJoCo cannot compile the arena, with the line that it names.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            spec = mujoco.MjSpec.from_string(_one_text(files))
            make_whole(spec)
            spec.compile()
    except REFUSALS as problem:
        message = " ".join(str(problem).split())
        # our message has a better place than MuJoCo's
        text = re.split(r" ?\bElement (?:name )?'", message)[0]
        text = re.sub(r"^(XML )?(Error: )+", "", text)
        place = _place(files, message)
        raise Unusable(error(TOPIC, f"MuJoCo: {text}", place)) from None
    return Places(
        _in_order(files, "geom", spec.geoms),
        _in_order(files, "body", spec.bodies),
        Place(files.main),
    )


def missing_files(files: SourceFiles) -> list[Finding]:
    """An error for files that elements name and that are not there."""
    if not files.missing:
        return []
    named = [f"'{name}'" for e in files.missing for name in named_files(e)]
    return [error(TOPIC, f"no file {names(named)}", _place_of(files.missing[0]))]


def settings_not_used(files: SourceFiles) -> list[str]:
    """An arena's settings of physics that are not used in a scene, as text."""
    inside = False
    found = []
    touch: dict[str, list[str]] = {name: [] for name in TOUCH}
    for element in files.elements:
        if element.depth == 1:
            inside = element.tag in ("option", "size")
        whole = element.tag == "compiler" and WHOLE_MODEL.keys() & element.attributes
        if whole or (inside and element.attributes):
            found.append(f"{element.shown} of line {element.line}")
        for name in TOUCH if element.tag == "geom" else ():
            if element.attributes.get(name, "0").strip("0. "):
                touch[name].append(f"line {element.line}")
    lines = [(name, lines) for name, lines in touch.items() if lines]
    return found + [f"{name} of geoms ({names(lines)})" for name, lines in lines]


TOUCH = ("margin", "gap", "priority")
"""Attributes of geoms that would change how the robot touches them."""


def _one_text(files: SourceFiles) -> str:
    """The arena's elements, one a line; files that they name by absolute paths."""
    lines, open_tags = [""] * ELEMENTS_MAX, list[str]()
    for element in files.elements:
        while len(open_tags) > element.depth:
            lines[-1] += f"</{open_tags.pop()}>"
        fields = "".join(
            f" {key}={quoteattr(_absolute(files, key, value))}"
            for key, value in element.attributes.items()
        )
        lines.append(f"<{element.tag}{fields}>")
        open_tags.append(element.tag)
    return "\n".join(lines) + "".join(f"</{tag}>" for tag in reversed(open_tags))


def _absolute(files: SourceFiles, key: str, value: str) -> str:
    """A file's path, if an attribute names one that was found."""
    if key.startswith("file"):
        for path in files.assets | files.xml.keys():
            if str(path).endswith(f"/{Path(value).as_posix().lstrip('./')}"):
                return str(path)
    return value


def _in_order(
    files: SourceFiles, tag: str, parts: Sequence[mujoco.MjsGeom | mujoco.MjsBody]
) -> tuple[Place, ...]:
    """Where parts of one kind were written, by their indices in the model."""
    found = {part.id: _place(files, part.info, tag) for part in parts}
    return tuple(found[i] for i in range(len(found)))


def _place(files: SourceFiles, said: str, tag: str = "") -> Place:
    """The element on the line that a text of MuJoCo's names, else the whole arena."""
    named = re.search(r"\bline (\d+)", said)
    line_said = int(named[1]) if named else 0
    line = line_said - ELEMENTS_MAX - 1
    if 0 <= line < len(files.elements):
        return _place_of(files.elements[line])
    # attached models have the line numbers of their own files
    there = [e for e in files.attached if e.tag == tag and e.line == line_said]
    if len(there) == 1:
        return _place_of(there[0])
    # of files that cannot be opened, it says the name only
    for element in files.elements:
        if f"'{element.attributes.get('file')}'" in said:
            return _place_of(element)
    return Place(files.main)


def _place_of(element: Element) -> Place:
    return Place(element.file, element.line, element.shown)
