"""Keys and values from YAML or JSON, read strictly, with one clear line if invalid.

Strictly: each key once, nothing that YAML's versions understand differently, no NaN in
JSON, and no more than a person's files have.
"""

import json
import re
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, NoReturn

import yaml

from epuck_mj.errors import UserError
from epuck_mj.host.files import read_text
from epuck_mj.host.limits import shown

YAML_MAX = 250_000
"""Most characters of a YAML text; a second reads about 100,000."""

JSON_MAX = 8_000_000
"""Most bytes of a JSON file."""

DEPTH_MAX = 20
"""Most mappings and lists inside one another."""

VALUES_MAX = 500_000
"""Most values of a text; those that are referred to again count again."""

DIGITS_MAX = 1000
"""Most digits of a number."""

DAMAGED = (
    ValueError,
    yaml.YAMLError,
    # of yaml's scalars: !!float '', !!binary ä
    KeyError,
    IndexError,
    AttributeError,
)
"""Exceptions that yaml and json raise for invalid texts."""


class _NotStrictError(Exception):
    """What can be parsed, but is not read; the message says why."""


def parse_yaml(text: str, where: str) -> Any:
    """Parse a text of YAML or JSON.

    Raises:
        UserError: beginning with `where`, if it is not YAML, or not strictly.
    """
    if len(text) > YAML_MAX:
        raise UserError(f"{where}: expected at most {YAML_MAX} characters of YAML")
    # of pyyaml's own loaders only this one knows no Python objects
    return _parsed(lambda text: yaml.load(text, _StrictLoader), text, where, "YAML")


def read_yaml(path: Path) -> dict[Any, Any]:
    """The keys and values of a file.

    Raises:
        UserError: if it is missing, not YAML, or anything but a mapping.
    """
    return _mapping(parse_yaml(read_text(path, YAML_MAX), f"'{path}'"), path)


def read_json(path: Path) -> dict[str, Any]:
    """The keys and values of a file.

    Raises:
        UserError: if it is missing, not JSON, or anything but an object.
    """
    text = read_text(path, JSON_MAX)
    return _mapping(_parsed(_strict_json, text, f"'{path}'", "JSON"), path)


def to_yaml(content: Any) -> str:
    """YAML text of plain values, keys in their order."""
    return yaml.safe_dump(content, sort_keys=False)


class _StrictLoader(yaml.SafeLoader):
    """SafeLoader that refuses repeated keys and scalars with several meanings."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
        """The keys and values of a mapping, if no key is there twice."""
        lines: dict[Hashable, int] = {}
        # others, by their tag a mapping, are refused below
        pairs = node.value if isinstance(node, yaml.MappingNode) else ()
        for key_node, _ in pairs:
            line = key_node.start_mark.line + 1
            if key_node.tag == "tag:yaml.org,2002:merge":
                raise _NotStrictError(
                    f"'<<' in line {line} is not allowed: expected keys"
                )
            key = self.construct_object(key_node, deep=True)
            # as are keys that cannot be looked up
            if isinstance(key, Hashable):
                if key in lines:
                    both = " and ".join(map(str, dict.fromkeys([lines[key], line])))
                    raise _NotStrictError(
                        f"key {shown(key)} appears twice, in line {both}"
                    )
                lines[key] = line
        return super().construct_mapping(node, deep=deep)

    def construct_plain(self, node: yaml.ScalarNode) -> Any:
        """A number, true or false, as every version of YAML reads it."""
        kind, text = node.tag.rpartition(":")[2], str(self.construct_scalar(node))
        _check_digits(text)
        if not PLAIN[kind].fullmatch(text):
            raise _NotStrictError(
                f"{shown(text)} in line {node.start_mark.line + 1} has several "
                "meanings in YAML: expected true, false, a decimal number, or a text "
                "in quotes"
            )
        return getattr(self, f"construct_yaml_{kind}")(node)


PLAIN = {
    "bool": re.compile(r"true|True|TRUE|false|False|FALSE"),
    "int": re.compile(r"[-+]?(0|[1-9][0-9]*)"),
    "float": re.compile(
        r"[-+]?[0-9]*\.?[0-9]*([eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan", re.I
    ),
    "timestamp": re.compile(r"(?!)"),
}
"""Scalars that mean the same in YAML 1.1, which pyyaml reads, and in 1.2.

Others are 010 (8 or 10), 1:30 (90 or a text), 1_000, yes, off and dates.
"""

for _kind in PLAIN:
    _StrictLoader.add_constructor(
        f"tag:yaml.org,2002:{_kind}", _StrictLoader.construct_plain
    )


def _strict_json(text: str) -> Any:
    return json.loads(
        text,
        object_pairs_hook=_once,
        parse_constant=_no_number,
        parse_float=_finite,
        parse_int=_whole,
    )


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise _NotStrictError(f"key {shown(twice)} appears twice")
    return content


def _no_number(text: str) -> NoReturn:
    raise _NotStrictError(f"expected a finite number, got {text}")


def _finite(text: str) -> float:
    number = float(text)
    return number if abs(number) < float("inf") else _no_number(text[:DIGITS_MAX])


def _whole(text: str) -> int:
    _check_digits(text)
    return int(text)


def _check_digits(text: str) -> None:
    if len(text) > DIGITS_MAX:
        raise ValueError(f"expected at most {DIGITS_MAX} digits, got {len(text)}")


def _parsed(parse: Callable[[str], Any], text: str, where: str, form: str) -> Any:
    try:
        content = parse(text)
        _refuse_deep(content)
    except RecursionError:
        raise UserError(f"{where} is not {form}: nested too deep") from None
    except _NotStrictError as error:
        raise UserError(f"{where}: {error}") from None
    except DAMAGED as error:
        reason = " ".join(str(error).split())
        raise UserError(f"{where} is not {form}: {reason}") from None
    return content


def _refuse_deep(content: Any) -> None:
    """Refuse what is nested too deep, and aliases of aliases that are too much."""
    waiting, n = [(content, 0)], 1
    while waiting:
        value, depth = waiting.pop()
        inside = value.values() if isinstance(value, dict) else value
        if not isinstance(value, dict | list):
            continue
        n += len(value)
        if depth == DEPTH_MAX or n > VALUES_MAX:
            raise _NotStrictError(
                f"expected at most {VALUES_MAX} values, in at most {DEPTH_MAX} "
                "mappings and lists inside one another"
            )
        waiting += [(each, depth + 1) for each in inside]


def _mapping(content: Any, path: Path) -> dict[Any, Any]:
    if not isinstance(content, dict):
        raise UserError(
            f"'{path}': expected a mapping of keys to values, "
            f"got {type(content).__name__}"
        )
    return content
