"""Configuration of a study: experiments that are compared on the same seeds."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from epuck_mj.errors import UserError
from epuck_mj.host.files import find
from epuck_mj.host.limits import shown
from epuck_mj.host.yaml_and_json import read_yaml, to_yaml
from evolution.settings.comparison import check_comparable, differing_keys
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config, shipped_with

KEYS = ("experiments", "common")

SEEDS = re.compile(r"(\d{1,18})(?:-(\d{1,18}))?", re.ASCII)

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", re.ASCII)

SEEDS_MAX = 10_000
"""Most seeds of one command."""

SEEDS_OF_STUDY_MAX = 100_000
"""Most seeds of an experiment, asked for by one command after the other."""


@dataclass(frozen=True)
class StudyConfig:
    """Experiments by name, in the order of every table and figure.

    Raises:
        UserError: if they cannot be compared.

    Attributes:
        experiments: the config of each, whose seed is not used.
    """

    experiments: Mapping[str, ExperimentConfig]

    def __post_init__(self) -> None:
        """Refuse experiments that no report can compare."""
        check_comparable(self.experiments)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a study from a file with the keys `experiments` and `common`.

        `experiments` is a list of shipped experiments and YAML files. An entry may also
        be a mapping of a new name to the key `like`, an experiment, and the keys in
        which it differs from that. `common` are keys that all of them get, whatever
        their files say; it may be left out.

        Raises:
            UserError: if a file is missing or says something unknown.
        """
        content = read_yaml(path)
        unknown = [key for key in content if key not in KEYS]
        if unknown:
            raise UserError(
                f"'{path}': unknown key '{unknown[0]}'; available: {', '.join(KEYS)}"
            )
        entries, common = content.get("experiments"), content.get("common")
        if not (isinstance(entries, list) and entries):
            raise UserError(
                f"'{path}': expected 'experiments', a list of experiments, got "
                + shown(entries)
            )
        # the key has no value
        common = {} if common is None else common
        if not isinstance(common, dict):
            raise UserError(
                f"'{path}': expected 'common', a mapping, got {shown(common)}"
            )
        if "seed" in common:
            raise UserError(
                f"'{path}', common: 'seed' has no effect here: expected --seeds"
            )
        experiments: dict[str, ExperimentConfig] = {}
        for entry in entries:
            name, fields, where = _entry(entry, path)
            if name in experiments:
                raise UserError(f"'{path}': two experiments are called '{name}'")
            # what an entry says is refused under its own name
            config = ExperimentConfig.parsed(fields, where)
            fields = config.model_dump() | common
            config = ExperimentConfig.parsed(fields, f"'{path}', common")
            experiments[name] = config.located()
        return cls(MappingProxyType(experiments))

    def only(self, names: list[str]) -> Self:
        """The study with only the experiments of these names.

        Raises:
            UserError: if one is not in the study.
        """
        for name in names:
            if name not in self.experiments:
                raise UserError(
                    f"no experiment '{name}' in the study; available: "
                    + ", ".join(self.experiments)
                )
        chosen = {name: self.experiments[name] for name in names}
        return type(self)(MappingProxyType(chosen))

    def with_seed(self, name: str, seed: int) -> ExperimentConfig:
        """The config of one run."""
        return self.experiments[name].model_copy(update={"seed": seed})

    def merged(self, other: Self, path: Path) -> Self:
        """This study, stored at `path`, with the experiments of another one added.

        If the other one has them all, they are in its order; else its own come last.

        Raises:
            UserError: naming the keys in which an experiment of both differs.
        """
        for name, config in other.experiments.items():
            if name not in self.experiments:
                continue
            differing = differing_keys(self.experiments[name], config)
            if differing:
                raise UserError(
                    f"'{path}' is a study of another config; experiment '{name}' "
                    f"differs in: {', '.join(differing)}"
                )
        both = {**self.experiments, **other.experiments}
        has_all = len(both) == len(other.experiments)
        order = other.experiments if has_all else both
        return type(self)(MappingProxyType({name: both[name] for name in order}))

    def to_yaml(self) -> str:
        """YAML text of all experiments with all their keys."""
        fields = {name: c.model_dump() for name, c in self.experiments.items()}
        return to_yaml(fields)

    @classmethod
    def from_yaml(cls, path: Path) -> Self:
        """Read what `to_yaml` wrote to a file.

        Raises:
            UserError: if it is not there, or damaged.
        """
        experiments = {
            str(name): ExperimentConfig.parsed(fields, f"'{path}', {name}")
            for name, fields in read_yaml(path).items()
        }
        if not experiments:
            raise UserError(f"'{path}': expected experiments, got none")
        return cls(MappingProxyType(experiments))


def _entry(entry: object, path: Path) -> tuple[str, dict[str, Any], str]:
    """An experiment's name, its keys and where they stand.

    Args:
        entry: of the list `experiments`.
        path: of the study.

    Raises:
        UserError: if it is no experiment, or its file is missing or says something
            unknown.
    """
    if isinstance(entry, str):
        file = find_config(entry)
        return file.stem, load_config(file).model_dump(), f"'{file}'"
    if not (isinstance(entry, dict) and len(entry) == 1):
        raise UserError(
            f"'{path}': expected 'experiments', a list of experiments or of a name "
            f"with the keys in which it differs from another, got {shown(entry)}"
        )
    ((name, keys),) = entry.items()
    if not (isinstance(name, str) and NAME.fullmatch(name)):
        raise UserError(
            f"'{path}': expected a name of letters, digits, dots, dashes and "
            f"underscores, got {shown(name)}"
        )
    where = f"'{path}', {name}"
    if not (isinstance(keys, dict) and isinstance(keys.get("like"), str)):
        raise UserError(f"{where}: expected 'like', an experiment, got {shown(keys)}")
    if "seed" in keys:
        raise UserError(f"{where}: 'seed' has no effect here: expected --seeds")
    fields = load_config(find_config(keys["like"])).model_dump()
    changed = {key: value for key, value in keys.items() if key != "like"}
    optimizer = changed.pop("optimizer", {})
    if not isinstance(optimizer, dict):
        raise UserError(
            f"{where}: expected 'optimizer', a mapping, got {shown(optimizer)}"
        )
    # another algorithm shares no keys with this one
    if "algorithm" not in optimizer:
        optimizer = fields["optimizer"] | optimizer
    return name, fields | changed | {"optimizer": optimizer}, where


def find_study(study: str) -> Path:
    """The file of a shipped study, or the user's own.

    Raises:
        UserError: if there is none.
    """
    return find(study, "study", shipped_with("experiments"), "a YAML")


def parse_seeds(text: str, most: int = SEEDS_MAX) -> list[int]:
    """Seeds of `1-30` or `1,3,5-8`, in ascending order.

    Args:
        text: of a person, or of `seeds_text`.
        most: number of seeds that is allowed.

    Raises:
        UserError: if it says anything else, names a seed twice, or too many.
    """
    seeds: list[int] = []
    for part in text.split(","):
        ends = SEEDS.fullmatch(part.strip())
        if ends is None:
            raise UserError(f"expected seeds as 1-30 or 1,3,5-8, got '{text}'")
        low, high = int(ends[1]), int(ends[2] or ends[1])
        if not low <= high:
            raise UserError(
                f"expected seeds from a lower to a higher one, got '{part}'"
            )
        if len(seeds) + high - low >= most:
            raise UserError(f"expected at most {most} seeds, got '{text}'")
        seeds += range(low, high + 1)
    if len(set(seeds)) < len(seeds):
        raise UserError(f"expected every seed once, got '{text}'")
    return sorted(seeds)


def seeds_text(seeds: Sequence[int]) -> str:
    """Ascending seeds as the command line takes them: 1-3,7."""
    groups: list[list[int]] = []
    for seed in seeds:
        if groups and seed == groups[-1][-1] + 1:
            groups[-1].append(seed)
        else:
            groups.append([seed])
    return ",".join(
        str(group[0]) if len(group) == 1 else f"{group[0]}-{group[-1]}"
        for group in groups
    )


def seeds_to_yaml(seeds: Mapping[str, Sequence[int]]) -> str:
    """YAML text of the ascending seeds of experiments by name."""
    texts = {name: seeds_text(each) for name, each in seeds.items()}
    return to_yaml(texts)


def seeds_from_yaml(path: Path) -> dict[str, list[int]]:
    """Read what `seeds_to_yaml` wrote to a file.

    Raises:
        UserError: if it is damaged.
    """
    stored = read_yaml(path)
    try:
        return {
            str(name): parse_seeds(str(text), SEEDS_OF_STUDY_MAX)
            for name, text in stored.items()
        }
    except UserError as error:
        raise UserError(f"'{path}': {error}") from None
