"""Findings as printed lines under headings, errors last."""

import os
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

from epuck_mj.check.findings import Finding, Place, Severity, errors, names

WIDTH = 88

ALIKE_MAX = 3
"""Most findings with one text that are printed in full."""

PLURALS = {Severity.ERROR: "errors", Severity.WARNING: "warnings"}


def lines(arena: Path, findings: Sequence[Finding]) -> Iterator[str]:
    """Lines with information by topic, then warnings and errors, then the outcome."""
    there = [finding for finding in findings if finding.severity is Severity.INFO]
    for topic in dict.fromkeys(finding.topic for finding in there):
        yield topic
        for finding in there:
            if finding.topic == topic:
                yield from _wrapped(finding.text)
    for severity in (Severity.WARNING, Severity.ERROR):
        alike: dict[tuple[str, str], list[Finding]] = {}
        for finding in findings:
            if finding.severity is severity:
                alike.setdefault((finding.topic, finding.text), []).append(finding)
        for group in alike.values():
            # a line for one more takes as much room as that one
            n = ALIKE_MAX if len(group) > ALIKE_MAX + 1 else len(group)
            yield from (_wrong(finding) for finding in group[:n])
            yield from _more(group[n:])
    outcome = "usable" if usable(findings) else "not usable"
    counts = ", ".join(_count(findings, severity) for severity in PLURALS)
    yield f"{_shown(arena)}: {outcome}; {counts}"


def usable(findings: Sequence[Finding]) -> bool:
    """Whether no finding is an error."""
    return not errors(findings)


def _wrapped(text: str) -> list[str]:
    """Lines of an indented paragraph."""
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent="  ",
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def _wrong(finding: Finding) -> str:
    """A warning or an error with its file and line, as compilers write it."""
    if finding.place is None:
        return f"{finding.severity}: {finding.topic}: {finding.text}"
    element = finding.place.element
    about = f"{element}: " if element else ""
    text = f"{about}{finding.text}{finding.where}"
    return f"{_where(finding.place)}: {finding.severity}: {text}"


def _more(alike: list[Finding]) -> Iterator[str]:
    """One line for more findings with a text that was printed already."""
    if alike:
        places = [finding.place for finding in alike if finding.place]
        shown = [
            place.element if "name=" in place.element else f"line {place.line}"
            for place in places
        ]
        start = f"{_where(places[0])}: " if places else ""
        text = f"the same of {len(alike)} more: {names(shown)}"
        yield f"{start}{alike[0].severity}: {text}"


def _where(place: Place) -> str:
    return f"{_shown(place.file)}:{place.line}" if place.line else _shown(place.file)


def _shown(path: Path) -> str:
    """A path as one would type it in the working directory."""
    near = os.path.relpath(path)
    return str(path) if near.startswith("..") else near


def _count(findings: Sequence[Finding], severity: Severity) -> str:
    n = sum(finding.severity is severity for finding in findings)
    return f"{n} {severity if n == 1 else PLURALS[severity]}"
