"""The files that an MJCF is compiled from, whatever tag names them.

MuJoCo does not say which files it has read. So the XML is searched for everything that
names a file: includes in includes, attached models, meshes, textures, height fields.
Files are looked for where MuJoCo looks for them, and never in the current folder.
"""

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host.files import is_file, read_text
from epuck_mj.scene.model_files import ROBOT_FILES
from epuck_mj.scene.robot_parts import OWN_BODY
from epuck_mj.scene.xml_elements import BadXml, Element, elements_of

XML_MAX = 50_000_000
"""Largest XML file that is read [bytes]."""

NOTHING = b"<mujoco><worldbody/></mujoco>"
"""What MuJoCo reads in place of a robot that an arena includes."""

DIRECTORIES = ("assetdir", "meshdir", "texturedir")
"""Attributes of `<compiler>` that name the folders of assets."""


@dataclass
class SourceFiles:
    """What an MJCF is compiled from.

    Attributes:
        main: path of the MJCF.
        xml: UTF-8 text of each XML file, by its path; NOTHING for a robot.
        elements: of the MJCF, those of included files in the place of the include.
        attached: elements of models that it attaches.
        assets: paths of all other files.
        missing: elements that name a file that is not there.
    """

    main: Path
    xml: dict[Path, bytes] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=list)
    attached: list[Element] = field(default_factory=list)
    assets: set[Path] = field(default_factory=set)
    missing: list[Element] = field(default_factory=list)

    def sha256(self) -> dict[Path, str]:
        """Hash of each file, the main file first.

        Raises:
            UserError: if a file cannot be read any more.
        """
        try:
            contents = {
                **{path: text for path, text in self.xml.items() if text != NOTHING},
                **{path: path.read_bytes() for path in sorted(self.assets)},
            }
        except OSError as error:
            raise UserError(
                f"cannot read '{error.filename}': {error.strerror}"
            ) from None
        return {
            path: hashlib.sha256(content).hexdigest()
            for path, content in contents.items()
        }


def source_files(main: Path, robots_stay: bool = False) -> SourceFiles:
    """The files of an MJCF; robots that it includes count as empty.

    Args:
        main: path of the MJCF.
        robots_stay: whether they do not.

    Raises:
        UserError: if an XML is missing or cannot be used.
    """
    found = SourceFiles(main)
    found.elements = _expanded(found, main, main.parent, robots_stay)
    _add_assets(found)
    return found


def defines_robot(elements: list[Element]) -> Element | None:
    """The element of a robot's body, if there is one."""
    return next(
        (
            e
            for e in elements
            if (e.tag, e.attributes.get("name")) == ("body", OWN_BODY)
        ),
        None,
    )


def _expanded(
    found: SourceFiles, path: Path, folder: Path, robots_stay: bool
) -> list[Element]:
    """Elements of an XML file of the model in a folder, includes expanded."""
    text = read_text(path, XML_MAX)
    own = elements_of(text, path)
    if path != found.main and not robots_stay and defines_robot(own):
        found.xml[path] = NOTHING
        return []
    found.xml[path] = text.encode()
    elements: list[Element] = []
    for element in own:
        if element.tag == "include":
            inner = _included(found, element, folder, robots_stay)
            if inner is not None:
                # its root is not included
                _, *parts = _expanded(found, inner, folder, robots_stay) or [element]
                lift = element.depth - 1
                elements += [replace(part, depth=part.depth + lift) for part in parts]
            continue
        elements.append(element)
        name = element.attributes.get("file", "")
        if element.tag == "model" and name.endswith(".xml"):
            inner = _first(folder / name, path.parent / name)
            if inner is not None and inner not in found.xml:
                found.attached += _expanded(found, inner, inner.parent, robots_stay)
    return elements


def _included(
    found: SourceFiles, element: Element, folder: Path, robots_stay: bool
) -> Path | None:
    """The file that an include names; None for a robot that is not there."""
    name = element.attributes.get("file", "")
    inner = _first(folder / name, element.file.parent / name) if name else None
    if inner is not None and inner not in found.xml:
        return inner
    if inner is not None:
        raise BadXml.of(element, f"'{name}' is already included")
    if Path(name).name in ROBOT_FILES.values() and not robots_stay:
        # a copied arena may name the robot that it left behind
        found.xml[_normal(folder / name)] = NOTHING
        return None
    raise BadXml.of(element, f"no file '{_normal(folder / name)}' to include")


def _add_assets(found: SourceFiles) -> None:
    """Add the files that elements name and that are no XML."""
    everything = found.elements + found.attached
    folders = {""} | {
        element.attributes[directory]
        for element in everything
        for directory in DIRECTORIES
        if element.tag == "compiler" and directory in element.attributes
    }
    for element in everything:
        for name in named_files(element):
            places = {
                _normal(start / folder / inner)
                for start in (found.main.parent, element.file.parent)
                for folder in folders
                # the second with the compiler's strippath
                for inner in (name, Path(name).name)
            }
            there = {place for place in places if is_file(place)} - found.xml.keys()
            found.assets |= there
            if not there and not any(place in found.xml for place in places):
                found.missing.append(element)


def named_files(element: Element) -> Iterator[str]:
    """Names of files in an element, by `file`, `fileright` and the like."""
    for key, value in element.attributes.items():
        if key.startswith("file") and value:
            yield value


def _first(*paths: Path) -> Path | None:
    return next((_normal(path) for path in paths if is_file(path)), None)


def _normal(path: Path) -> Path:
    return Path(os.path.normpath(path))
