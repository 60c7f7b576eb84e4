"""What a study has found so far, read back from its directory."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from epuck_mj import controller
from epuck_mj.controller import ControllerFile
from epuck_mj.errors import UserError
from evolution.config import ExperimentConfig, differing_keys
from evolution.experiment import HISTORY
from evolution.run_directory import RunDirectory
from evolution.study_directory import StudyDirectory

YARDSTICK = "wall-follower"
"""What the hand-written wall follower is called among the experiments."""


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
            `held_out`.
        missing: what is not there and why, a line each.
    """

    path: Path
    configs: Mapping[str, ExperimentConfig]
    runs: Mapping[str, tuple[RunData, ...]]
    robots: tuple[str, ...]
    steps: int
    yardstick: Mapping[str, Mapping]
    missing: tuple[str, ...]

    def held_out(self, name: str, robot: str) -> np.ndarray:
        """Held-out fitness of an experiment's champions, `(runs,)`."""
        return np.array([run.held_out(robot) for run in self.runs[name]])

    def stored(self, name: str) -> np.ndarray:
        """Stored fitness of an experiment's champions, `(runs,)`."""
        return np.array([run.stored for run in self.runs[name]])


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
    for name, experiment in config.experiments.items():
        finished = []
        for seed in directory.seeds(name):
            try:
                finished.append(_run(directory.run(name, seed), experiment, seed))
            except UserError as error:
                missing.append(f"{name} seed {seed}: {error}")
        runs[name] = tuple(finished)
        if not finished:
            missing.append(f"{name}: no finished run")
    everything = [run for each in runs.values() for run in each]
    if not everything:
        raise UserError(f"no finished run in '{path}': {'; '.join(missing)}")
    missing += _unpaired(runs)
    robots = {tuple(run.champion.scores["held_out"]) for run in everything}
    steps = {run.champion.task["steps"] for run in everything}
    if len(robots) > 1 or len(steps) > 1:
        raise UserError(
            f"expected runs on the same robots and as many steps in '{path}', got "
            f"robots {sorted(robots)} and steps {sorted(steps)}"
        )
    return StudyData(
        path=path,
        configs=config.experiments,
        runs=runs,
        robots=robots.pop(),
        steps=steps.pop(),
        yardstick=_yardstick(directory),
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
    champion = controller.load(directory.champion)
    tests = champion.scores.get("held_out")
    if not tests or not all("mean" in test for test in tests.values()):
        raise UserError(f"'{directory.champion}' has no held-out fitness")
    return RunData(seed, read_history(directory.history), champion, directory.path)


def read_history(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history.csv, `(generations,)` each.

    Raises:
        UserError: if it cannot be read, or is damaged.
    """
    try:
        header, *lines = path.read_text(encoding="utf-8").splitlines()
        rows = np.array([[float(x) for x in line.split(",")] for line in lines])
        if header != ",".join(HISTORY) or rows.ndim != 2 or not len(rows):
            raise ValueError(f"expected rows of {','.join(HISTORY)}")
        columns = dict(zip(HISTORY, rows.T, strict=True))
        if (np.diff(columns["evaluations"]) <= 0).any() or np.isnan(rows).any():
            raise ValueError("evaluations do not rise, or a value is missing")
    except OSError as error:
        raise UserError(f"cannot read '{path}': {error.strerror}") from None
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


def _yardstick(directory: StudyDirectory) -> dict[str, dict]:
    """Scores of the hand-written wall follower; empty if it was never tested.

    Raises:
        UserError: if they are damaged.
    """
    path = directory.yardstick
    if not path.is_file():
        return {}
    try:
        fields = json.loads(path.read_text(encoding="utf-8"))
        return dict(fields["held_out"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(f"cannot read '{path}': {error}") from None
