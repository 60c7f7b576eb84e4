"""XML texts: refused if they are nested deep or huge, before a parser recurses in them.

expat, which counts here, needs no stack for elements; those that build trees do.
"""

from pathlib import Path
from xml.parsers import expat

from epuck_mj.errors import UserError

DEPTH_MAX = 100
"""Most elements inside one another."""

ELEMENTS_MAX = 100_000
"""Most elements of a file."""


def check_xml(text: str, path: Path) -> None:
    """Refuse a text that is no XML, nested too deep, too long, or has own entities.

    Args:
        text: as `files.read_text` gives it, whatever encoding it declares.
        path: of the file, for the message.

    Raises:
        UserError: for such a text.
    """
    depth = n = 0
    parser = expat.ParserCreate()

    def start(name: str, attributes: object) -> None:
        nonlocal depth, n
        depth, n = depth + 1, n + 1
        if depth > DEPTH_MAX or n > ELEMENTS_MAX:
            raise _refusal(
                f"expected at most {ELEMENTS_MAX} elements, at most {DEPTH_MAX} inside "
                f"one another"
            )

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1

    def entity(name: str, *others: object) -> None:
        raise _refusal(f"expected no entities of its own, got '{name}'")

    def _refusal(what: str) -> UserError:
        return UserError(f"'{path}', line {parser.CurrentLineNumber}: {what}")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise UserError(f"'{path}' is not XML: {error}") from None
