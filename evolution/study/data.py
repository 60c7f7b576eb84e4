"""What a study has found so far, read back from its directory."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, StrictInt, ValidationError

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.yaml_and_json import read_json
from epuck_mj.policies import file as controller_file
from epuck_mj.policies.file import ControllerFile
from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.run.directory import RunDirectory
from evolution.run.generation_loop import HISTORY
from evolution.settings.config import ExperimentConfig, differing_keys
from evolution.study.config import seeds_text
from evolution.study.directory import StudyDirectory


@dataclass(frozen=True, eq=False)
class RunData:
    """A finished run.

    Attributes:
        seed: its seed.
        history: columns of history.csv by name, `(generations,)` each.
        champion: the champion, its scores with it.
        path: its directory.
    """

    seed: int
    history: Mapping[str, np.ndarray]
    champion: ControllerFile
    path: Path

    @property
    def stored(self) -> float:
        """What evolution believes of the champion."""
        return self.champion.scores["stored"]

    def held_out(self, robot: str) -> float:
        """The champion's mean on the test starts."""
        return self.champion.scores["held_out"][robot]["mean"]

    def held_out_as_evolved(self, robot: str) -> float:
        """The same with the disturbances it evolved with; nan if not tested so."""
        tests = self.champion.scores.get("held_out_as_evolved", {})
        return tests[robot]["mean"] if robot in tests else math.nan


@dataclass(frozen=True, eq=False)
class StudyData:
    """The finished runs of a study.

    Attributes:
        path: the study's directory.
        configs: of the experiments, in the study's order.
        runs: of each experiment, by ascending seed; there may be none.
        robots: that every champion was tested on; the one it evolved on comes first.
        steps: control steps of a trial: the most that a fitness can be.
        yardstick: scores of the hand-written wall follower by robot, as a champion's
            `held_out`; empty if not known, or not for all of these experiments.
        missing: what is not there and why, a line each.
    """

    path: Path
    configs: Mapping[str, ExperimentConfig]
    runs: Mapping[str, tuple[RunData, ...]]
    robots: tuple[str, ...]
    steps: int
    yardstick: Mapping[str, Mapping]
    missing: tuple[str, ...]

    @property
    def with_runs(self) -> dict[str, tuple[RunData, ...]]:
        """The runs of the experiments that have any, in the study's order."""
        return {name: self.runs[name] for name in self.configs if self.runs.get(name)}

    def alike(self, a: str, b: str) -> bool:
        """Whether fitness of two experiments is worth the same, and costs the same."""
        one, other = self.configs[a], self.configs[b]
        return one.setting == other.setting and one.budget == other.budget

    def yardstick_mean(self, robot: str) -> float | None:
        """Held-out fitness of the hand-written wall follower, None if not known."""
        return self.yardstick.get(robot, {}).get("mean")

    def held_out(self, name: str, robot: str) -> np.ndarray:
        """Held-out fitness of an experiment's champions, `(runs,)`."""
        return np.array([run.held_out(robot) for run in self.runs[name]])

    def stored(self, name: str) -> np.ndarray:
        """Stored fitness of an experiment's champions, `(runs,)`."""
        return np.array([run.stored for run in self.runs[name]])

    def best_stored(self, name: str) -> np.ndarray:
        """Highest stored fitness that each run has seen, `(runs,)`: the paper's."""
        return np.array([run.history["best"].max() for run in self.runs[name]])


def load_study(path: Path) -> StudyData:
    """Everything in a study directory that is finished and sound.

    Raises:
        UserError: if it is not a study, has no finished run, or mixes trials of
            different length or robots.
    """
    directory = StudyDirectory(path)
    config = directory.stored_config()
    runs: dict[str, tuple[RunData, ...]] = {}
    missing: list[str] = []
    asked = directory.asked_seeds()
    for name, experiment in config.experiments.items():
        finished = []
        for seed in directory.seeds(name):
            try:
                finished.append(_run(directory.run(name, seed), experiment, seed))
            except UserError as error:
                missing.append(f"{name} seed {seed}: {error}")
        runs[name] = tuple(finished)
        not_begun = set(asked.get(name, ())) - set(directory.seeds(name))
        if not_begun:
            seeds = seeds_text(sorted(not_begun))
            missing.append(f"{name} seeds {seeds}: asked for, not there")
        elif not finished:
            missing.append(f"{name}: no finished run")
    everything = [run for each in runs.values() for run in each]
    if not everything:
        said = "; ".join([*missing[:3], "..."] if len(missing) > 3 else missing)
        raise UserError(f"no finished run in '{path}': {said}")
    missing += _unpaired({n: each for n, each in runs.items() if n not in asked})
    robots = {tuple(run.champion.scores["held_out"]) for run in everything}
    steps = {run.champion.task.steps for run in everything}
    if len(robots) > 1 or len(steps) > 1:
        raise UserError(
            f"expected runs on the same robots and as many steps in '{path}', got "
            f"robots {sorted(robots)} and steps {sorted(steps)}"
        )
    tested = robots.pop()
    yardstick: Mapping[str, Mapping] = {}
    configs = config.experiments
    first, *others = configs
    differing = [n for n in others if configs[n].setting != configs[first].setting]
    if differing:
        missing.append(
            f"comparisons with {first}: arena, task or start clearance of "
            f"{', '.join(differing)} are others"
        )
    unequal = [n for n in others if configs[n].budget != configs[first].budget]
    if unequal:
        missing.append(
            f"comparisons with {first}: evaluations times trials of "
            f"{', '.join(unequal)} are others"
        )
    try:
        if not differing:
            yardstick = _yardstick(directory, tested)
    except UserError as error:
        missing.append(f"{YARDSTICK}: {error}")
    return StudyData(
        path=path,
        configs=configs,
        runs=runs,
        robots=tested,
        steps=steps.pop(),
        yardstick=yardstick,
        missing=tuple(missing),
    )


def _run(directory: RunDirectory, config: ExperimentConfig, seed: int) -> RunData:
    """A finished run.

    Raises:
        UserError: if it is not finished, damaged, or of another config.
    """
    if not directory.finished:
        raise UserError("not finished")
    stored = directory.stored_config()
    differing = differing_keys(stored, config.model_copy(update={"seed": seed}))
    if differing:
        raise UserError(f"of another config: {', '.join(differing)}")
    champion = controller_file.load(directory.champion)
    check_scores(champion.scores, directory.champion)
    return RunData(seed, read_history(directory.history), champion, directory.path)


class _Test(BaseModel):
    """What reports read of a held-out evaluation."""

    mean: FiniteFloat
    standard_deviation: FiniteFloat | None = None
    interval: tuple[float, float] | None = None
    worst: FiniteFloat | None = None
    crash_rate: FiniteFloat
    starts: StrictInt = Field(gt=0)
    behaviour: dict[str, FiniteFloat] | None = None
    metrics: dict[str, FiniteFloat | None] | None = None


class _Believed(BaseModel):
    stored: FiniteFloat
    held_out: FiniteFloat


class _Yardstick(BaseModel):
    held_out: dict[str, _Test] = Field(min_length=1)


class _Scores(_Yardstick):
    stored: FiniteFloat
    held_out_as_evolved: dict[str, _Test] = {}
    most_believed: _Believed | None = None


def check_scores(scores: Any, path: Path, kind: type[BaseModel] = _Scores) -> None:
    """Nothing, if the scores in the file at `path` are all there and numbers.

    Raises:
        UserError: naming what is not.
    """
    try:
        kind.model_validate(scores)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "scores"
        raise UserError(f"'{path}' is damaged: {where}: {first['msg']}") from None


def read_history(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history.csv, `(generations,)` each.

    Raises:
        UserError: if it cannot be read, or is damaged.
    """
    text = files.read_text(path)
    try:
        header, *lines = text.splitlines()
        rows = np.array([[float(x) for x in line.split(",")] for line in lines])
        if header != ",".join(HISTORY) or rows.ndim != 2 or not len(rows):
            raise ValueError(f"expected rows of {','.join(HISTORY)}")
        columns = dict(zip(HISTORY, rows.T, strict=True))
        spent = np.diff(columns["evaluations"], prepend=0)
        if (spent <= 0).any() or not np.isfinite(rows).all():
            raise ValueError("evaluations do not rise, or a value is not finite")
    except ValueError as error:
        raise UserError(f"'{path}' is damaged: {error}") from None
    return columns


def _unpaired(runs: Mapping[str, tuple[RunData, ...]]) -> list[str]:
    """Seeds that some experiments have and others lack, a line per experiment."""
    seeds = {name: {run.seed for run in each} for name, each in runs.items()}
    everywhere = set().union(*seeds.values())
    return [
        f"{name}: no finished run of seed {', '.join(map(str, sorted(lacking)))}"
        for name, found in seeds.items()
        if found and (lacking := everywhere - found)
    ]


def _yardstick(directory: StudyDirectory, robots: Sequence[str]) -> dict[str, dict]:
    """Scores of the hand-written wall follower; empty if it was never tested.

    Raises:
        UserError: if they are damaged.
    """
    path = directory.yardstick
    if not path.is_file():
        return {}
    fields = read_json(path)
    check_scores(fields, path, _Yardstick)
    missing = [robot for robot in robots if robot not in fields["held_out"]]
    if missing:
        raise UserError(f"'{path}' has no test on {missing[0]}")
    return fields["held_out"]
