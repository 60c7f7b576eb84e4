"""YAML, read safely: a mapping of keys to values or one clear line."""

from pathlib import Path
from typing import Any

import yaml

from epuck_mj.errors import UserError
from epuck_mj.files import read_text


def parse(text: str, where: str) -> Any:
    """What a text says.

    Raises:
        UserError: beginning with `where`, if it is not YAML.
    """
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise UserError(f"{where} is not YAML: {reason}") from None


def read_mapping(path: Path) -> dict[Any, Any]:
    """The keys and values of a file.

    Raises:
        UserError: if it is missing, not YAML, or anything but a mapping.
    """
    content = parse(read_text(path), f"'{path}'")
    if not isinstance(content, dict):
        raise UserError(
            f"'{path}': expected a mapping of keys to values, "
            f"got {type(content).__name__}"
        )
    return content


def to_yaml(content: Any) -> str:
    """The text of plain values, keys in their order."""
    return yaml.safe_dump(content, sort_keys=False)
