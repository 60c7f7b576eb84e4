"""Score shipped champions again: `python -m evolution.verify results/paper/...`.

MuJoCo gives the same bits for one version on one type of processor only. Where the
fitness differs, what else differs is named.
"""

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import tyro

from epuck_mj import controller
from epuck_mj.command_line import check_threads, main, parse
from epuck_mj.errors import UserError
from epuck_mj.model import load_scene
from evolution.held_out import Judge
from evolution.provenance import processor
from evolution.run_directory import RunDirectory
from evolution.study_data import check_scores

MODULE = "evolution.verify"


@dataclass(frozen=True)
class Options:
    """Score the champions of finished runs again and compare with what is written.

    Exit status 1 if one differs.

    Attributes:
        paths: run directories, or study directories for all their runs.
        threads: threads that step the robots; 0 is one per core. Changes no result.
    """

    paths: tyro.conf.Positional[tuple[Path, ...]]
    threads: int = 0


def verify(argv: Sequence[str]) -> int:
    """Run the command line; its exit status.

    Raises:
        UserError: for anything the user can put right.
    """
    options = parse(Options, f"python -m {MODULE}", argv)
    check_threads(options.threads)
    runs = [run for path in options.paths for run in _runs(path)]
    if not runs:
        raise UserError("expected run or study directories")
    same = [_verified(run, options.threads) for run in runs]
    print(f"{sum(same)} of {len(same)} champions score the same to the last bit")
    return 0 if all(same) else 1


def _runs(path: Path) -> list[RunDirectory]:
    """The runs at a path.

    Raises:
        UserError: if there are none.
    """
    champions = [*path.glob("champion.json"), *path.glob("*/seed-*/champion.json")]
    if not champions:
        raise UserError(
            f"no champion in '{path}': expected the directory of a finished run, or "
            "of a study with one"
        )
    return [RunDirectory(champion.parent) for champion in sorted(champions)]


def _verified(run: RunDirectory, threads: int) -> bool:
    """Whether the champion scores the same; says so, or what differs."""
    config, champion = run.stored_config(), controller.load(run.champion)
    check_scores(champion.scores, run.champion)
    differing = []
    for robot, written in champion.scores["held_out"].items():
        # its own robot may be a file
        named = config.robot if Path(config.robot).name == robot else robot
        scene = load_scene(named, config.arena, config.control_step)
        judge = Judge(scene, config.task, config.start_clearance, threads)
        again = judge.test(champion.controller, written["starts"])
        if again.mean != written["mean"]:
            differing.append(
                f"{robot} {written['mean']!r} is now {again.mean!r} "
                f"({again.mean - written['mean']:+.3g}, 95 % CI "
                f"{again.interval[0]:.1f} to {again.interval[1]:.1f})"
            )
        before = champion.scene.get("mjcf_sha256")
        if named == champion.scene.get("robot") and before != dict(scene.sha256):
            differing.append(f"{robot}: its robot or arena has been edited since")
    if differing:
        causes = _changes(run.provenance_fields())
        print(f"{run.path}: {'; '.join(differing)}")
        print(
            f"  since then: {'; '.join(causes) or 'nothing that is recorded changed'}"
        )
    else:
        print(f"{run.path}: the same to the last bit")
    return not differing


def _changes(provenance: dict) -> list[str]:
    """Versions and processor that are not those of the run, a text each."""
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
