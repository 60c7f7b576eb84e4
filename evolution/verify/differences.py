"""Differences between what is written and what would be written, in few lines."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Any

MISSING = object()
"""In the place of a value that one side does not have."""

SHOWN, LENGTH = 3, 40
"""Differences that a line shows, and characters of a value."""

Difference = tuple[tuple[str | int, ...], Any, Any]
"""Keys and indices that lead to a value, the value there is, and what it would be."""


def lines_of_differences(file: str, written: Any, now: Any) -> list[str]:
    """A line for each part of a file that differs; none if all is the same.

    Args:
        file: its name.
        written: its content, of mappings, lists and plain values.
        now: what would be written now.
    """
    groups: dict[str, list[str]] = {}
    for where, before, after in _differences(written, now, ()):
        keys = [each for each in where[:-1] if isinstance(each, str)][:3]
        # values of a list belong to it, others to what is around them
        rest = [str(each) for each in where[len(keys) :]]
        text = f"{'.'.join(rest)} {_difference(before, after)}"
        groups.setdefault(".".join(keys), []).append(text)
    return [
        f"{file}{', ' if group else ''}{group}: {', '.join(texts[:SHOWN])}"
        + (f" and {len(texts) - SHOWN} more" if len(texts) > SHOWN else "")
        for group, texts in groups.items()
    ]


def said(now: Any, written: Any) -> Any:
    """What would be written now, without the keys that the file does not have."""
    if not (isinstance(now, Mapping) and isinstance(written, Mapping)):
        return now
    return {key: said(now[key], written[key]) for key in now if key in written}


def unsaid(now: Any, written: Any, inside: str = "") -> list[str]:
    """Keys that the file does not have, with dots in between."""
    if not (isinstance(now, Mapping) and isinstance(written, Mapping)):
        return []
    keys = [f"{inside}{key}" for key in now if key not in written]
    for key in now:
        if key in written:
            keys += unsaid(now[key], written[key], f"{inside}{key}.")
    return keys


def _differences(
    written: Any, now: Any, where: tuple[str | int, ...]
) -> Iterator[Difference]:
    if isinstance(written, Mapping) and isinstance(now, Mapping):
        for key in {**now, **written}:
            yield from _differences(
                written.get(key, MISSING), now.get(key, MISSING), (*where, key)
            )
    elif _is_list(written) and _is_list(now):
        for i, (a, b) in enumerate(zip_longest(written, now, fillvalue=MISSING)):
            yield from _differences(a, b, (*where, i))
    # the same number and the same type; a float tells all its bits
    elif repr(written) != repr(now):
        yield where, written, now


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _difference(written: Any, now: Any) -> str:
    if written is MISSING:
        return f"is missing, expected {_shown(now)}"
    if now is MISSING:
        return f"{_shown(written)}, expected none"
    return f"{_shown(written)} is now {_shown(now)}"


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= LENGTH else f"{text[: LENGTH - 3]}..."
