"""Configuration of a study: experiments that are compared on the same seeds."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Self

from epuck_mj.errors import UserError
from epuck_mj.host.files import find
from epuck_mj.host.limits import shown
from epuck_mj.host.yaml_and_json import read_yaml, to_yaml
from evolution.settings.comparison import check_comparable, differing_keys
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config, shipped_with

KEYS = ("experiments", "common")

SEEDS = re.compile(r"(\d{1,18})(?:-(\d{1,18}))?", re.ASCII)

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

        `experiments` is a list of shipped experiments and YAML files. `common` are keys
        that all of them get, whatever their files say; it may be left out.

        Raises:
            UserError: if a file is missing or says something unknown.
        """
        content = read_yaml(path)
        unknown = [key for key in content if key not in KEYS]
        if unknown:
            raise UserError(
                f"'{path}': unknown key '{unknown[0]}'; available: {', '.join(KEYS)}"
            )
        names, common = content.get("experiments"), content.get("common")
        if not (
            isinstance(names, list)
            and names
            and all(isinstance(name, str) for name in names)
        ):
            raise UserError(
                f"'{path}': expected 'experiments', a list of experiments, got "
                + shown(names)
            )
        # nothing behind the colon
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
        for name in names:
            file = find_config(name)
            if file.stem in experiments:
                raise UserError(f"'{path}': two experiments are called '{file.stem}'")
            fields = load_config(file).model_dump() | common
            config = ExperimentConfig.parsed(fields, f"'{path}', common")
            experiments[file.stem] = config.located()
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
        return type(self)(MappingProxyType({**self.experiments, **other.experiments}))

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
