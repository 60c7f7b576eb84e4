"""Places of an arena's geoms in its XML files.

MuJoCo names the line of an element, but not in files that are included. So elements are
written into a single text, one a line, below lines that no attached model reaches.
"""

import re
import warnings
from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco

from epuck_mj.check.findings import Place, Unusable, error
from epuck_mj.scene.source_files import SourceFiles, source_files
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


def geom_places(files: SourceFiles) -> tuple[Place, ...]:
    """Where each geom of an arena was written, in the model's order.

    Raises:
        Unusable: if MuJoCo cannot compile the arena, with the line that it names.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            spec = mujoco.MjSpec.from_string(_one_text(files))
            spec.compile()
    except REFUSALS as problem:
        message = " ".join(str(problem).split())
        # what MuJoCo says of the place, we say better
        text = re.split(r" ?\bElement (?:name )?'", message)[0]
        text = re.sub(r"^(XML )?(Error: )+", "", text)
        place = _place(files, message)
        raise Unusable(error(TOPIC, f"MuJoCo: {text}", place)) from None
    geoms = {geom.id: _place(files, geom.info) for geom in spec.geoms}
    return tuple(geoms[i] for i in range(len(geoms)))


def settings_not_used(files: SourceFiles) -> list[Element]:
    """Elements of an arena with physics that is the robot's own in a scene."""
    inside = False
    found = []
    for element in files.elements:
        if element.depth == 1:
            inside = element.tag in ("option", "size")
        whole = element.tag == "compiler" and not WHOLE.isdisjoint(element.attributes)
        if whole or (inside and element.attributes):
            found.append(element)
    return found


WHOLE = {"settotalmass", "boundmass", "boundinertia", "balanceinertia"}
"""Settings of the compiler that would change masses of the robot."""


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


def _place(files: SourceFiles, said: str) -> Place:
    """The element on the line that a text of MuJoCo's names, else the whole arena."""
    named = re.search(r"\bline (\d+)", said)
    line = int(named[1]) - ELEMENTS_MAX - 1 if named else -1
    if 0 <= line < len(files.elements):
        return _place_of(files.elements[line])
    # of files that cannot be opened, it says the name only
    for element in files.elements:
        if f"'{element.attributes.get('file')}'" in said:
            return _place_of(element)
    return Place(files.main)


def _place_of(element: Element) -> Place:
    return Place(element.file, element.line, element.shown)
