"""Test shipped champions again: `python -m evolution.verify results/paper/...`.

MuJoCo gives the same bits only for one version on one type of processor. Where the
fitness differs, differing versions and processors are printed.
"""

import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.command_line import check_threads, main, parse, word
from epuck_mj.policies.file import ControllerFile, load_controller
from evolution.judging.held_out_starts import held_out_disturbances
from evolution.judging.scores import Scores
from evolution.run.directory import RunDirectory
from evolution.run.provenance import processor
from evolution.settings.config import ExperimentConfig
from evolution.settings.randomness import Purpose
from evolution.study.directory import champions

if TYPE_CHECKING:
    from evolution.judging.held_out import Judges

MODULE = "evolution.verify"


EXAMPLES = (
    "python -m evolution.verify runs/ga-seed-1",
    "python -m evolution.verify results/paper",
)


@dataclass(frozen=True)
class Options:
    """Test the champions of finished runs again and compare with their stored scores.

    The exit status is 1 if a score differs.

    Attributes:
        paths: run directories, or study directories to verify all their runs.
        threads: threads that step the robots; 0 is one per core. Changes no result.
    """

    paths: tyro.conf.Positional[Annotated[tuple[Path, ...], word("RUN")]]
    threads: int = 0


def verify(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    check_threads(options.threads)
    runs = [run for path in options.paths for run in _runs(path)]
    if not runs:
        raise UserError("expected run or study directories")
    # simulators are for a command that makes sense
    from evolution.judging.held_out import Judges

    judges = Judges(options.threads)
    same = [_verified(run, judges) for run in runs]
    print(f"{sum(same)} of {len(same)} champions score the same to the last bit")
    return 0 if all(same) else 1


def _runs(path: Path) -> list[RunDirectory]:
    """The runs at a path.

    Raises:
        UserError: if there are none.
    """
    found = champions(path)
    if not found:
        raise UserError(
            f"no champion in '{path}': expected the directory of a finished run, or "
            "of a study with one"
        )
    return [RunDirectory(champion.parent) for champion in found]


def _verified(run: RunDirectory, judges: "Judges") -> bool:
    """Verify a run and print the outcome; whether all scores are the same."""
    config, champion = run.stored_config(), load_controller(run.champion)
    scores = Scores.read(champion.scores, run.champion)
    differing = [
        *_differing(champion, scores, config, judges),
        *_most_believed(run, scores, config, judges),
        *_edited(champion, config, judges),
    ]
    if differing:
        causes = changes(run.provenance_fields())
        print(f"{run.path}: {'; '.join(differing)}")
        print(
            f"  since then: {'; '.join(causes) or 'nothing that is recorded changed'}"
        )
    else:
        print(f"{run.path}: the same to the last bit")
    return not differing


def _differing(
    champion: ControllerFile, scores: Scores, config: ExperimentConfig, judges: "Judges"
) -> Iterator[str]:
    """Differences between the champion's held-out tests and its stored scores."""
    for tests in (scores.held_out, scores.held_out_as_evolved):
        for robot, written in tests.items():
            n, met, where = written.starts, None, robot
            if tests is scores.held_out_as_evolved:
                met = held_out_disturbances(
                    config.conditions, Purpose.TEST, n, config.steps
                )
                where = f"{robot} as evolved on"
            # its own robot may be a file
            named = config.robot if Path(config.robot).name == robot else robot
            test = judges.of(named, config.setting).test(champion.controller, n, met)
            before, now = written.to_dict(), test.to_dict()
            if test.mean != written.mean:
                low, high = test.interval
                yield (
                    f"{where} {written.mean!r} is now {test.mean!r} "
                    f"({test.mean - written.mean:+.3g}, 95 % CI {low:.1f} to "
                    f"{high:.1f})"
                )
            elif others := [key for key in before if now[key] != before[key]]:
                yield f"{where}, the same mean, but other {', '.join(others)}"


def _most_believed(
    run: RunDirectory, scores: Scores, config: ExperimentConfig, judges: "Judges"
) -> Iterator[str]:
    """Differences in the fitness of the individual with the highest stored fitness."""
    written = scores.most_believed
    if written is None or not files.is_file(run.best_individuals):
        return
    best = files.read_arrays(run.best_individuals)
    try:
        genome = best["genomes"][best["fitness"].argmax()]
        policy = config.topology.decode(genome)
    except (KeyError, ValueError, IndexError) as error:
        raise UserError(f"'{run.best_individuals}' is damaged: {error}") from None
    mean = judges.of(config.robot, config.setting).test(policy, config.test_starts).mean
    if mean != written.held_out:
        yield f"the most believed {written.held_out!r} is now {mean!r}"


def _edited(
    champion: ControllerFile, config: ExperimentConfig, judges: "Judges"
) -> Iterator[str]:
    """Texts about robot, arena and own parts that were edited since the run."""
    now = dict(judges.of(config.robot, config.setting).scene.sha256)
    if champion.origin.mjcf_sha256 != now:
        yield "its robot or arena has been edited since"
    own = config.own_parts
    for name, sha256 in champion.origin.own_sha256.items():
        if own.get(name) != sha256:
            yield f"'{name}' has been edited since"


def changes(provenance: dict) -> list[str]:
    """Versions and processor that differ from those of the run, a text each."""
    changes = []
    for package, before in provenance.get("versions", {}).items():
        now = _version(package)
        if now != before:
            changes.append(f"{package} {before} is now {now}")
    before, now = provenance.get("processor", {}), processor()
    if before.get("model") != now["model"]:
        changes.append(f"processor {before.get('model')} is now {now['model']}")
    flags, have = set(before.get("flags", ())), set(now["flags"])
    if flags - have:
        changes.append(f"CPU flags gone: {' '.join(sorted(flags - have))}")
    if have - flags:
        changes.append(f"CPU flags new: {' '.join(sorted(have - flags))}")
    return changes


def _version(package: str) -> str:
    if package == "python":
        return platform.python_version()
    try:
        return version(package)
    except PackageNotFoundError:
        return "not there"


if __name__ == "__main__":
    main(verify)
