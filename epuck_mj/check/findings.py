"""What a check finds: a plain line, how bad it is, and where in the XML it is from."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from epuck_mj.errors import UserError


class Severity(StrEnum):
    """How bad a finding is."""

    ERROR = "error"
    """The arena cannot be used as it is."""
    WARNING = "warning"
    """It can, but something is probably not as it was meant."""
    INFO = "info"
    """What is there."""


@dataclass(frozen=True)
class Place:
    """Where something was written.

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
    """

    topic: str
    severity: Severity
    text: str
    place: Place | None = None


def info(topic: str, text: str) -> Finding:
    """What is there."""
    return Finding(topic, Severity.INFO, text)


def warning(topic: str, text: str, place: Place | None) -> Finding:
    """What is probably not as it was meant."""
    return Finding(topic, Severity.WARNING, text, place)


def error(topic: str, text: str, place: Place | None) -> Finding:
    """What makes an arena useless."""
    return Finding(topic, Severity.ERROR, text, place)


class Unusable(UserError):
    """An error that leaves nothing else to check."""

    def __init__(self, finding: Finding):
        """Stop with that finding."""
        super().__init__(finding.text)
        self.finding = finding
