"""Data of a study: its finished runs, read from its tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host.yaml_and_json import read_json
from epuck_mj.policies.wall_follower import YARDSTICK
from epuck_mj.scene.model_files import is_on_wheels, on_wheels
from evolution.judging.held_out import tested_on
from evolution.judging.scores import HeldOut, KnownScores, Scores
from evolution.run.directory import RunDirectory
from evolution.settings.config import ExperimentConfig
from evolution.study.config import StudyConfig, seeds_text
from evolution.study.directory import StudyDirectory
from evolution.study.finished_run import FinishedRun, read_finished


@dataclass(frozen=True, eq=False)
class StudyData:
    """The finished runs of a study.

    Attributes:
        path: the study's directory.
        configs: of the experiments, in the study's order.
        runs: of each experiment, by ascending seed; there may be none.
        robots: that every champion was tested on, as `held_out.tested_on` orders them.
        steps: control steps of a trial: the most that a fitness can be.
        yardstick: tests of the hand-written wall follower by robot; empty if not
            known, or not for all of these experiments.
        missing: what is not there and why, a line each.
    """

    path: Path
    configs: Mapping[str, ExperimentConfig]
    runs: Mapping[str, tuple[FinishedRun, ...]]
    robots: tuple[str, ...]
    steps: int
    yardstick: Mapping[str, HeldOut]
    missing: tuple[str, ...]

    @property
    def rungs(self) -> tuple[str, str] | None:
        """The robot that evolution began on, and the other of the two tested on.

        None if champions were tested on one robot only.
        """
        if len(self.robots) < 2:
            return None
        first, last = self.robots[0], self.robots[-1]
        begun = {Path(config.robot).name for config in self.configs.values()}
        return (last, first) if last in begun else (first, last)

    @property
    def wheels(self) -> str:
        """The shipped robot on wheels on which champions are reported."""
        return on_wheels(next(iter(self.configs.values())).robot)

    @property
    def with_runs(self) -> dict[str, tuple[FinishedRun, ...]]:
        """The runs of the experiments that have any, in the study's order."""
        return {name: self.runs[name] for name in self.configs if self.runs.get(name)}

    def alike(self, a: str, b: str) -> bool:
        """Whether two experiments have comparable fitness and the same budget."""
        one, other = self.configs[a], self.configs[b]
        return one.setting == other.setting and one.budget == other.budget

    def yardstick_mean(self, robot: str) -> float | None:
        """Held-out fitness of the hand-written wall follower, None if not known."""
        test = self.yardstick.get(robot)
        return None if test is None else test.mean

    def held_out(self, name: str, robot: str) -> np.ndarray:
        """Held-out fitness of an experiment's champions, `(runs,)`."""
        return np.array([run.held_out(robot) for run in self.runs[name]])

    def stored(self, name: str) -> np.ndarray:
        """Stored fitness of an experiment's champions, `(runs,)`."""
        return np.array([run.scores.stored for run in self.runs[name]])

    def best_stored(self, name: str) -> np.ndarray:
        """Highest stored fitness that each run has seen, `(runs,)`: the paper's."""
        return np.array([run.history["best"].max() for run in self.runs[name]])


def load_study(path: Path) -> StudyData:
    """Read the finished and valid runs of a study directory.

    Raises:
        UserError: if it is not a study that can be compared, or has no finished run.
    """
    directory = StudyDirectory(path)
    config = directory.stored_config()
    runs, missing = _finished(directory, config)
    everything = [run for each in runs.values() for run in each]
    if not everything:
        said = "; ".join([*missing[:3], "..."] if len(missing) > 3 else missing)
        raise UserError(f"no finished run in '{path}': {said}")
    asked, tested = directory.asked_seeds(), tuple(everything[0].scores.held_out)
    missing += _unpaired({n: each for n, each in runs.items() if n not in asked})
    configs = config.experiments
    first, *others = configs
    differing = [n for n in others if configs[n].setting != configs[first].setting]
    if differing:
        missing.append(
            f"comparisons with {first} of {', '.join(differing)}, whose arena, task "
            "or start clearance is another"
        )
    unequal = [n for n in others if configs[n].budget != configs[first].budget]
    if unequal:
        missing.append(
            f"comparisons with {first} of {', '.join(unequal)}, whose number of trials "
            "(evaluations times trials) is another"
        )
    yardstick: Mapping[str, HeldOut] = {}
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
        steps=configs[first].steps,
        yardstick=yardstick,
        missing=tuple(missing),
    )


def _finished(
    directory: StudyDirectory, config: StudyConfig
) -> tuple[dict[str, tuple[FinishedRun, ...]], list[str]]:
    """The finished and valid runs of each experiment; what is missing, and why."""
    # before the tables: a run that is packed meanwhile is in these
    places = {name: list(directory.runs(name)) for name in config.experiments}
    packed, damaged = directory.tables.sound_runs(config)
    runs: dict[str, tuple[FinishedRun, ...]] = {}
    missing: list[str] = []
    tested: tuple[str, ...] = ()
    asked = directory.asked_seeds()
    for name, experiment in config.experiments.items():
        finished = []
        # runs of killed studies and of older studies
        unpacked: dict[int, list[RunDirectory]] = {}
        for seed, place in places[name]:
            unpacked.setdefault(seed, []).append(place)
        in_tables = {seed for each, seed in (*packed, *damaged) if each == name}
        seeds = sorted(in_tables | unpacked.keys())
        for seed in seeds:
            try:
                if (name, seed) in damaged:
                    raise damaged[name, seed]
                run = packed.get((name, seed)) or _unpacked(
                    unpacked[seed], name, config.with_seed(name, seed)
                )
                _check_tests(run, experiment, tested)
                tested = tuple(run.scores.held_out)
                finished.append(run)
            except UserError as error:
                missing.append(f"{name} seed {seed}: {error}")
        runs[name] = tuple(finished)
        not_begun = set(asked.get(name, ())) - set(seeds)
        if not_begun:
            text = seeds_text(sorted(not_begun))
            missing.append(f"{name} seeds {text}: asked for, not there")
        elif not finished:
            missing.append(f"{name}: no finished run")
    return runs, missing


def _unpacked(
    places: Sequence[RunDirectory], name: str, config: ExperimentConfig
) -> FinishedRun:
    """A finished run that is not in the tables yet, from the first place that has it.

    Raises:
        UserError: if it is not finished, damaged, or of another config.
    """
    finished = [place for place in places if place.finished]
    return read_finished((finished or places)[0], name, config)


def _check_tests(
    run: FinishedRun, config: ExperimentConfig, tested: tuple[str, ...]
) -> None:
    """Refuse a run that was tested on other robots than those before it.

    Args:
        run: to be checked.
        config: of its experiment.
        tested: the robots that those before were tested on.

    Raises:
        UserError: for such a run.
    """
    scores = run.scores
    expected = tested or _tested_on(config, scores)
    for tests in (scores.held_out, scores.held_out_as_evolved):
        if tests and tuple(tests) != expected:
            raise UserError(
                f"'{run.path}': tested on {', '.join(tests)}, expected "
                + ", ".join(expected)
            )


def _tested_on(config: ExperimentConfig, scores: Scores) -> tuple[str, ...]:
    """Names of the robots on which the first run has to be tested."""
    tests = tuple(scores.held_out)
    # champions of wheels were once tested on another robot besides, or on none
    if is_on_wheels(config.robot) and tests[0] == config.robot:
        return tests
    return tuple(Path(robot).name for robot in tested_on(config.robot))


def _unpaired(runs: Mapping[str, tuple[FinishedRun, ...]]) -> list[str]:
    """Lines about seeds that some experiments have and others lack."""
    seeds = {name: {run.seed for run in each} for name, each in runs.items()}
    everywhere = set().union(*seeds.values())
    return [
        f"{name}: no finished run of seed {', '.join(map(str, sorted(lacking)))}"
        for name, found in seeds.items()
        if found and (lacking := everywhere - found)
    ]


def _yardstick(
    directory: StudyDirectory, robots: Sequence[str]
) -> Mapping[str, HeldOut]:
    """Tests of the hand-written wall follower; empty if it was never tested.

    Raises:
        UserError: if they are damaged.
    """
    path = directory.yardstick
    if not path.is_file():
        return {}
    tests = KnownScores.read(read_json(path), path).held_out
    missing = [robot for robot in robots if robot not in tests]
    if missing:
        raise UserError(f"'{path}' has no test on {missing[0]}")
    return tests
