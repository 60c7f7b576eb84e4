"""Elements of an XML file, with the lines on which they stand."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from xml.parsers import expat

from epuck_mj.errors import UserError

DEPTH_MAX = 500
"""Most elements inside one another; MuJoCo's parser stops there, too."""

ELEMENTS_MAX = 200_000
"""Most elements of a file."""


@dataclass(frozen=True)
class Element:
    """One element of an XML.

    Attributes:
        tag: its name.
        attributes: as written.
        file: path of the XML.
        line: on which it begins, from 1.
        depth: how many elements are around it.
    """

    tag: str
    attributes: Mapping[str, str]
    file: Path
    line: int
    depth: int

    @property
    def shown(self) -> str:
        """The tag with its name or another attribute."""
        for key in ("name", "file", "class"):
            if key in self.attributes:
                return f'<{self.tag} {key}="{self.attributes[key]}">'
        return f"<{self.tag}>"


class BadXml(UserError):
    """An XML that cannot be used, with the line where it is wrong."""

    def __init__(
        self, problem: str, file: Path, line: int = 0, element: Element | None = None
    ):
        """Store what is wrong and where; line 0 stands for the file as a whole."""
        super().__init__(f"'{file}'{f', line {line}' if line else ''}: {problem}")
        self.problem, self.file, self.line, self.element = problem, file, line, element

    @classmethod
    def of(cls, element: Element, problem: str) -> Self:
        """Something wrong with an element."""
        return cls(problem, element.file, element.line, element)


def elements_of(text: str, path: Path) -> list[Element]:
    """Elements of an XML in the order of its text.

    Raises:
        BadXml: if it is not well-formed, too deep, too long, or defines entities.
    """
    parser = expat.ParserCreate("utf-8")
    elements: list[Element] = []
    depth = 0

    def refuse(problem: str) -> None:
        raise BadXml(problem, path, parser.CurrentLineNumber)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        if depth == DEPTH_MAX:
            refuse(f"expected at most {DEPTH_MAX} elements inside one another")
        if len(elements) == ELEMENTS_MAX:
            refuse(f"expected at most {ELEMENTS_MAX:,} elements")
        elements.append(Element(tag, attributes, path, parser.CurrentLineNumber, depth))
        depth += 1

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1

    def entity(*_: object) -> None:
        refuse("expected no definitions of entities")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        problem = f"not well-formed XML: {expat.ErrorString(error.code)}"
        raise BadXml(problem, path, error.lineno) from None
    return elements
