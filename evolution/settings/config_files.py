"""Experiments in YAML files: shipped ones and the user's own."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

from epuck_mj.host.files import find
from epuck_mj.host.yaml_and_json import read_yaml
from evolution.settings.config import ExperimentConfig

CONFIGS = Path(__file__).resolve().parent.parent / "configs"
DEFAULT_EXPERIMENT = "de-best"


@cache
def shipped_with(key: str) -> Mapping[str, Path]:
    """The shipped files by name that have this key, in the order of their names."""
    files = sorted(CONFIGS.glob("*.yaml"), key=lambda path: path.stem)
    found = {path.stem: path for path in files if key in read_yaml(path)}
    return MappingProxyType(found)


def shipped_experiments() -> Mapping[str, Path]:
    """Files of the shipped experiments by name; studies are in the same folder."""
    return shipped_with("optimizer")


def find_config(experiment: str) -> Path:
    """The file of a shipped experiment, or the user's own.

    Raises:
        UserError: if there is none.
    """
    return find(experiment, "experiment", shipped_experiments(), "a YAML")


def load_config(path: Path) -> ExperimentConfig:
    """Read an experiment.

    Raises:
        UserError: if the file is missing, not YAML, or says something unknown.
    """
    return ExperimentConfig.parsed(read_yaml(path), f"'{path}'")
