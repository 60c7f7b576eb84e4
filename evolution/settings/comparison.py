"""Comparison of configurations."""

from collections.abc import Mapping, Sequence
from typing import Any

from epuck_mj.errors import UserError
from evolution.settings.config import ExperimentConfig


def differing_keys(stored: ExperimentConfig, asked: ExperimentConfig) -> list[str]:
    """Keys in which two configs differ, with both values, a text each."""
    return [
        f"{key} (stored {values.get('stored')}, got {values.get('asked')})"
        for key, values in differences({"stored": stored, "asked": asked}).items()
    ]


def check_comparable(configs: Mapping[str, ExperimentConfig]) -> None:
    """Refuse experiments whose runs could not stand in the tables of one report.

    Other keys may differ: a report says which experiments it does not compare.

    Args:
        configs: by the experiments' names.

    Raises:
        UserError: naming the key that has to be the same, and all its values.
    """
    for key in COMPARABLE:
        values = {name: getattr(config, key) for name, config in configs.items()}
        if len(set(values.values())) > 1:
            each = ", ".join(f"{name} {value}" for name, value in values.items())
            raise UserError(
                f"experiments of one study have to have the same {key}, got {each}"
            )


COMPARABLE = ("robot", "steps")
"""Keys that the experiments of a study share."""


def differences(
    configs: Mapping[str, ExperimentConfig], without: Sequence[str] = ()
) -> dict[str, dict[str, Any]]:
    """Keys in which configs differ, and the value of each config that has the key.

    Args:
        configs: by name.
        without: keys that may differ.
    """
    each = {name: flat(config) for name, config in configs.items()}
    keys = dict.fromkeys(key for fields in each.values() for key in fields)
    found = {
        key: {name: fields[key] for name, fields in each.items() if key in fields}
        for key in keys
        if key not in without
    }
    return {
        key: values
        for key, values in found.items()
        if len(values) < len(each) or len(set(map(repr, values.values()))) > 1
    }


def flat(config: ExperimentConfig) -> dict[str, Any]:
    """Keys and values, the optimiser's as `optimizer.<key>`."""
    fields = config.model_dump()
    optimizer = fields.pop("optimizer")
    return fields | {f"optimizer.{key}": value for key, value in optimizer.items()}
