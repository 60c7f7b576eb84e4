"""Errors of a configuration in one line."""

from collections.abc import Sequence
from dataclasses import fields

from pydantic import ValidationError

from epuck_mj.host.limits import shown
from evolution.search.table import ALGORITHMS

COMPLETE = "complete"
"""Type of an error whose message says itself what was got."""


def one_line(error: ValidationError, keys: Sequence[str], optimizer: type) -> str:
    """All errors of a config in one line, with the known keys if one is unknown.

    Args:
        error: of the config.
        keys: that a config may have.
        optimizer: dataclass of the parameters of a user's optimiser; of shipped ones,
            the error says which.
    """
    parts = []
    for detail in error.errors():
        key = ".".join(str(part) for part in detail["loc"] if part not in ALGORITHMS)
        if detail["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
            available = ", ".join(_keys(detail["loc"], keys, optimizer))
            parts.append(f"unknown key '{key}'; available: {available}")
        elif detail["type"] == "missing":
            parts.append(f"key '{key}' is missing")
        elif not detail["loc"]:
            # of several keys together
            parts.append(detail["msg"].removeprefix("Value error, "))
        else:
            message = detail["msg"].removeprefix("Value error, ")
            # checks of a part as a whole may say themselves what came
            of_whole = detail["type"] == "value_error" and ", got " in message
            said = of_whole or detail["type"] == COMPLETE
            got = "" if said else f", got {shown(detail['input'])}"
            parts.append(f"{key}: {message}{got}")
    return "; ".join(parts)


def _keys(
    loc: tuple[int | str, ...], keys: Sequence[str], optimizer: type
) -> Sequence[str]:
    """The known keys in the place of the unknown key at `loc`."""
    if len(loc) == 1:
        return keys
    return [field.name for field in fields(ALGORITHMS.get(str(loc[1]), optimizer))]
