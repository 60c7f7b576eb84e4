"""Fields of a file of results, checked against a pydantic model."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from epuck_mj.errors import UserError
from epuck_mj.host.limits import shown


def check_fields(kind: type[BaseModel], fields: Mapping[str, Any], path: Path) -> None:
    """Refuse fields of a file that are not of a kind.

    Raises:
        UserError: naming the first value that is something else.
    """
    try:
        kind.model_validate(fields)
    except ValidationError as error:
        raise damaged(path, error) from None


def damaged(path: Path, error: ValidationError) -> UserError:
    """The error that a file has a wrong value, the first one if there are several."""
    first = error.errors()[0]
    where = ".".join(map(str, first["loc"])) or "fields"
    what = first["msg"].removeprefix("Value error, ")
    if first["type"] != "missing" and ", got " not in what:
        what += f", got {shown(first['input'])}"
    return UserError(f"'{path}' is damaged: {where}: {what}")
