"""Policies by name: a run, a study, a file, or wall-follower.

Policies that can be evaluated and replayed are champions, the best individuals of
earlier generations, and the hand-written wall follower.
"""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, load_controller
from epuck_mj.policies.wall_follower import YARDSTICK, WallFollower
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT, on_wheels
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import START_CLEARANCE, Policy, TaskParameters
from evolution.judging.scores import KnownScores
from evolution.run.directory import RunDirectory
from evolution.run.history import read_best_individuals
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import load_config
from evolution.study.addresses import PlacedRun, runs_at

LAST = "last"
"""Word for the latest generation."""


@dataclass(frozen=True)
class NamedPolicy:
    """A policy with its origin.

    Attributes:
        source: path or name that a person gave it by.
        policy: itself.
        task: what its trials were.
        robot: that it was evolved on.
        arena: that it was evolved in.
        start_clearance: least distance from the shell to a wall at its starts [m].
        scores: what is known of its worth.
        config: of its run, if that is known.
        variant: which of the source's policies it is, if there are more.
    """

    source: str
    policy: Policy
    task: TaskParameters
    robot: str = KINEMATIC_ROBOT
    arena: str = "arena"
    start_clearance: float = START_CLEARANCE
    scores: KnownScores = field(default_factory=KnownScores)
    config: ExperimentConfig | None = None
    variant: str = ""

    @property
    def conditions(self) -> Conditions:
        """Conditions in which the policy evolved; ideal robots if unknown."""
        return self.config.conditions if self.config else Conditions()

    @property
    def name(self) -> str:
        """Name of the policy beside others."""
        return f"{self.source} {self.variant}".rstrip()


def common_wheels(policies: Sequence[NamedPolicy]) -> str:
    """The shipped robot on wheels of all policies; `epuck` where they differ."""
    found = {on_wheels(policy.robot) for policy in policies}
    return found.pop() if len(found) == 1 else WHEELED_ROBOT


def named_policies(path: str, generations: str | None = None) -> list[NamedPolicy]:
    """The policies at a path, at least one.

    Args:
        path: a run or study directory, `STUDY/EXPERIMENT/seed-N`, a controller file, or
            `wall-follower`.
        generations: instead of champions, the best individuals of these generations of
            a run: numbers from 0 on and `last`, with commas in between.

    Raises:
        UserError: if there are none.
    """
    if generations is not None:
        return _best_individuals(Path(path), generations)
    if path == YARDSTICK:
        return [NamedPolicy(YARDSTICK, WallFollower(), TaskParameters())]
    place = Path(path)
    if files.is_file(place):
        run = RunDirectory(place.parent)
        beside = place == run.champion and files.is_file(run.config)
        return [_champion(place, path, run.stored_config() if beside else None)]
    found = [policy for run in runs_at(place) for policy in _of_run(run)]
    if not found:
        raise UserError(
            f"no champion in '{path}': expected the directory of a finished run, "
            f"or of a study with one, STUDY/EXPERIMENT/seed-N, a controller file, or "
            f"{YARDSTICK}"
        )
    return found


def _of_run(run: PlacedRun) -> list[NamedPolicy]:
    """The champion of a run, if there is one."""
    if not isinstance(run, RunDirectory):
        scores = KnownScores.read(run.champion.scores, run.path)
        return [_policy(run.champion, str(run.path), scores, run.config)]
    if not files.is_file(run.champion):
        return []
    config = load_config(run.config) if files.is_file(run.config) else None
    return [_champion(run.champion, str(run.path), config)]


def policies_of(
    paths: Iterable[str], generations: str | None = None
) -> list[NamedPolicy]:
    """The policies at several paths; see `named_policies`.

    Raises:
        UserError: if there are no paths, or no policies at one.
    """
    found = [each for path in paths for each in named_policies(path, generations)]
    if not found:
        raise UserError(
            f"expected run or study directories, controller files, or {YARDSTICK}"
        )
    return found


def _champion(path: Path, name: str, config: ExperimentConfig | None) -> NamedPolicy:
    file = load_controller(path)
    return _policy(file, name, KnownScores.read(file.scores, path), config)


def _policy(
    file: ControllerFile,
    name: str,
    scores: KnownScores,
    config: ExperimentConfig | None,
) -> NamedPolicy:
    clearance = file.origin.start_clearance
    if clearance is None:
        clearance = config.start_clearance if config else START_CLEARANCE
    return NamedPolicy(
        name,
        file.controller,
        file.task,
        file.origin.robot,
        file.origin.arena,
        clearance,
        scores,
        config,
    )


def _best_individuals(path: Path, generations: str) -> list[NamedPolicy]:
    """The best individuals of some generations of a run, which need not be finished.

    Raises:
        UserError: if there are none, or they are in no file.
    """
    run = RunDirectory(path)
    if not files.is_directory(path) and runs_at(path):
        raise UserError(
            f"'{path}' is a row of a table, without the best individuals of its "
            f"generations; to do the run again: python -m evolution.export {path} "
            "config.yaml, then python -m evolution.run config.yaml"
        )
    for file in (run.config, run.best_individuals):
        if not files.is_file(file):
            raise UserError(
                f"no '{file}': expected a run that has saved its generations"
            )
    config = run.stored_config()
    n_genes = config.topology.n_genes
    genomes, fitness = read_best_individuals(run.best_individuals, n_genes)
    return [
        NamedPolicy(
            str(run.path),
            config.topology.decode(genomes[generation]),
            config.task,
            config.robot,
            config.arena,
            config.start_clearance,
            KnownScores(stored=float(fitness[generation])),
            config,
            f"generation {generation}",
        )
        for generation in dict.fromkeys(_indices(generations, len(fitness)))
    ]


def _indices(generations: str, n: int) -> Iterator[int]:
    """Numbers of the generations that a text names; there are `n` generations."""
    for word in generations.split(","):
        index = n - 1 if word.strip() == LAST else _number(word)
        if index is None or index >= n:
            raise UserError(
                f"expected generations from 0 to {n - 1} or {LAST}, with commas in "
                f"between, got '{generations}'"
            )
        yield index


def _number(word: str) -> int | None:
    return int(word) if re.fullmatch(r"\s*\d{1,9}\s*", word) else None


def described(policy: NamedPolicy) -> str:
    """Description of a policy in Markdown."""
    lines = [f"## {policy.name}", "", *_scores(policy.scores), ""]
    config = policy.config
    settings = config.to_yaml() if config else _plain(policy)
    return "\n".join([*lines, "```", settings.rstrip(), "```", ""])


def _plain(policy: NamedPolicy) -> str:
    fields = {"robot": policy.robot, "arena": policy.arena, **asdict(policy.task)}
    return "\n".join(f"{key}: {value}" for key, value in fields.items())


def _scores(scores: KnownScores) -> Iterator[str]:
    """Lines of Markdown, one per known score."""
    for fitness, title in (
        (scores.stored, "Stored fitness, from its trials in evolution"),
        (scores.validation, "On validation starts, where the champion was chosen"),
    ):
        if not math.isnan(fitness):
            yield f"- {title}: {fitness:.1f}"
    for robot, test in scores.held_out.items():
        yield (
            f"- Held-out fitness, {robot}: {test.mean:.1f} over {test.starts:,} "
            f"starts, {test.crash_rate:.1%} crash"
        )
