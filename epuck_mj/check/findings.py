"""Findings of a check: a line of text, its severity, and its place in the XML."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from epuck_mj.errors import UserError

NAMES_MAX = 6
"""Most names of one kind that are listed."""


class Severity(StrEnum):
    """How bad a finding is."""

    ERROR = "error"
    """The arena cannot be used as it is."""
    WARNING = "warning"
    """The arena can be used, but something is probably wrong."""
    INFO = "info"
    """Information about the arena."""


@dataclass(frozen=True)
class Place:
    """File and line of an element.

    Attributes:
        file: path of the XML.
        line: of the element, from 1; 0 stands for the file as a whole.
        element: as written, with its name; empty for the file as a whole.
    """

    file: Path
    line: int = 0
    element: str = ""


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Attributes:
        topic: heading under which it is reported.
        severity: how bad it is.
        text: one line.
        place: what it is about, if that was written somewhere.
        where: where in the arena it was met, if that is not all of it.
    """

    topic: str
    severity: Severity
    text: str
    place: Place | None = None
    where: str = ""


def info(topic: str, text: str) -> Finding:
    """A finding that informs about the arena."""
    return Finding(topic, Severity.INFO, text)


def warning(topic: str, text: str, place: Place | None, where: str = "") -> Finding:
    """A finding about something that is probably wrong."""
    return Finding(topic, Severity.WARNING, text, place, where)


def error(topic: str, text: str, place: Place | None, where: str = "") -> Finding:
    """A finding with which the arena cannot be used."""
    return Finding(topic, Severity.ERROR, text, place, where)


def names(shown: Sequence[str]) -> str:
    """The first of some names, and how many more there are."""
    more = f" and {len(shown) - NAMES_MAX} more" if len(shown) > NAMES_MAX else ""
    return ", ".join(shown[:NAMES_MAX]) + more


def errors(findings: Iterable[Finding]) -> list[Finding]:
    """The errors among findings."""
    return [found for found in findings if found.severity is Severity.ERROR]


class Unusable(UserError):
    """An error after which nothing else can be checked."""

    def __init__(self, finding: Finding):
        """Store the finding."""
        super().__init__(finding.text)
        self.finding = finding
