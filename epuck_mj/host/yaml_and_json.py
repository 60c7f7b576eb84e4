"""Keys and values from YAML or JSON, read safely, with one clear line if invalid."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from epuck_mj.errors import UserError
from epuck_mj.host.files import read_text

DAMAGED = (
    ValueError,
    RecursionError,
    yaml.YAMLError,
    # of yaml's scalars: !!bool x, !!int '', !!timestamp x
    KeyError,
    IndexError,
    AttributeError,
)
"""Exceptions that yaml and json raise for invalid texts."""


def parse_yaml(text: str, where: str) -> Any:
    """Parse a text of YAML or JSON.

    Raises:
        UserError: beginning with `where`, if it is not YAML.
    """
    return _parsed(yaml.safe_load, text, where, "YAML")


def read_yaml(path: Path) -> dict[Any, Any]:
    """The keys and values of a file.

    Raises:
        UserError: if it is missing, not YAML, or anything but a mapping.
    """
    return _mapping(parse_yaml(read_text(path), f"'{path}'"), path)


def read_json(path: Path) -> dict[str, Any]:
    """The keys and values of a file.

    Raises:
        UserError: if it is missing, not JSON, or anything but an object.
    """
    return _mapping(_parsed(json.loads, read_text(path), f"'{path}'", "JSON"), path)


def to_yaml(content: Any) -> str:
    """YAML text of plain values, keys in their order."""
    return yaml.safe_dump(content, sort_keys=False)


def _parsed(parse: Callable[[str], Any], text: str, where: str, form: str) -> Any:
    try:
        return parse(text)
    except DAMAGED as error:
        reason = " ".join(str(error).split())
        raise UserError(f"{where} is not {form}: {reason}") from None


def _mapping(content: Any, path: Path) -> dict[Any, Any]:
    if not isinstance(content, dict):
        raise UserError(
            f"'{path}': expected a mapping of keys to values, "
            f"got {type(content).__name__}"
        )
    return content
