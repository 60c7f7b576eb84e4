"""Held-out evaluation: `python -m evolution.evaluate PATH... [options]`."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from epuck_mj import controller, files
from epuck_mj.command_line import check_threads, main, parse
from epuck_mj.control import Policy, TaskParameters
from epuck_mj.errors import UserError
from epuck_mj.model import load_scene
from epuck_mj.tasks import START_CLEARANCE
from epuck_mj.wall_follower import WallFollower
from evolution.champion import N_TEST
from evolution.config import load_config
from evolution.held_out import HeldOut, Judge
from evolution.results import PLANAR_ROBOT, WHEELED_ROBOT
from evolution.run_directory import RunDirectory
from evolution.study_data import YARDSTICK

MODULE = "evolution.evaluate"
STARTS_MAX = 100_000


@dataclass(frozen=True)
class Options:
    """Test champions on starts that evolution has never seen, and say what they do.

    Attributes:
        paths: run or study directories, controller files, or wall-follower, the one
            written by hand.
        starts: how many test starts: the first of always the same.
        robot: robot to test on; the one it evolved on and the one on wheels if not
            given.
        arena: arena to test in; the one it evolved in if not given.
        threads: threads that step the robots; 0 is one per core. Changes no result.
        json: also write everything to this file.
    """

    paths: tyro.conf.Positional[tuple[str, ...]]
    starts: int = N_TEST
    robot: str | None = None
    arena: str | None = None
    threads: int = 0
    json: Path | None = None


@dataclass(frozen=True)
class Candidate:
    """A policy, and where it comes from."""

    name: str
    policy: Policy
    task: TaskParameters
    robot: str = "epuck_planar"
    arena: str = "arena"
    start_clearance: float = START_CLEARANCE


def evaluate(argv: Sequence[str]) -> int:
    """Run the command line; its exit status.

    Raises:
        UserError: for anything the user can put right.
    """
    options = parse(Options, f"python -m {MODULE}", argv)
    if not 2 <= options.starts <= STARTS_MAX:
        raise UserError(f"expected 2 to {STARTS_MAX} starts, got {options.starts}")
    check_threads(options.threads)
    if not options.paths:
        raise UserError(
            f"expected run or study directories, controller files, or {YARDSTICK}"
        )
    candidates = [found for path in options.paths for found in _candidates(path)]
    judges: dict[tuple, Judge] = {}
    tests = []
    for candidate in candidates:
        other = PLANAR_ROBOT if candidate.robot == WHEELED_ROBOT else WHEELED_ROBOT
        robots = [options.robot] if options.robot else [candidate.robot, other]
        arena = options.arena or candidate.arena
        for robot in dict.fromkeys(robots):
            key = (robot, arena, candidate.task, candidate.start_clearance)
            if key not in judges:
                scene = load_scene(robot, arena, candidate.task.control_step)
                judges[key] = Judge(
                    scene, candidate.task, candidate.start_clearance, options.threads
                )
            test = judges[key].test(candidate.policy, options.starts)
            print(f"{candidate.name}, {Path(robot).name} in {Path(arena).name}")
            print(_described(test, candidate.task.steps), flush=True)
            where = {"name": candidate.name, "robot": robot, "arena": arena}
            tests.append(where | asdict(test))
    if options.json is not None:
        with files.writing(options.json.parent):
            files.write_text(options.json, json.dumps(tests, indent=1) + "\n")
    return 0


def _candidates(path: str) -> Iterator[Candidate]:
    """The champions at a path.

    Raises:
        UserError: if there are none.
    """
    if path == YARDSTICK:
        yield Candidate(YARDSTICK, WallFollower(), TaskParameters())
        return
    place = Path(path)
    champions = [place]
    if not files.is_file(place):
        # a run's own, or those of all the runs of a study
        champions = sorted(place.glob("champion.json")) or sorted(
            place.glob("*/seed-*/champion.json"),
            key=lambda p: (p.parent.parent.name, len(p.parent.name), p.parent.name),
        )
        if not champions:
            raise UserError(
                f"no champion in '{path}': expected the directory of a finished run, "
                "or of a study with one"
            )
    for champion in champions:
        file = controller.load(champion)
        yield Candidate(
            str(champion.parent if place.is_dir() else champion),
            file.controller,
            TaskParameters.from_dict(file.task),
            _scene(file.scene, "robot", champion),
            _scene(file.scene, "arena", champion),
            _start_clearance(champion.parent) if place.is_dir() else START_CLEARANCE,
        )


def _start_clearance(run: Path) -> float:
    """The one that a run's champion was tested with; its file does not say."""
    config = RunDirectory(run).config
    return load_config(config).start_clearance if config.is_file() else START_CLEARANCE


def _scene(fields: dict, key: str, path: Path) -> str:
    value = fields.get(key)
    if not isinstance(value, str):
        raise UserError(f"'{path}' does not say which {key} it is for")
    return value


def _described(test: HeldOut, steps: int) -> str:
    """The outcome for a person, indented."""
    low, high = test.interval
    metrics = test.metrics
    shares = sorted(test.behaviour.items(), key=lambda item: -item[1])
    did = ", ".join(f"{name} {share:.1%}" for name, share in shares if share > 0)
    return (
        f"  fitness of {steps}: mean {test.mean:.1f} (95 % CI {low:.1f} to "
        f"{high:.1f}), sd {test.standard_deviation:.1f}, worst 5 % {test.worst:.1f}, "
        f"{test.starts} starts\n"
        f"  crashes: {test.crash_rate:.1%} of the trials, "
        f"{test.collisions_per_minute:.2f} per minute\n"
        f"  behaviour: {did}\n"
        f"  near a wall {_number(metrics['share_near_wall'], 100, '%')} of the time, "
        f"{_number(metrics['clearance_mean'], 1000, 'mm')} off it "
        f"(sd {_number(metrics['clearance_sd'], 1000, 'mm')}, least "
        f"{_number(metrics['clearance_min'], 1000, 'mm')}), first after "
        f"{_number(metrics['time_to_first_wall'], 1, 's')}\n"
        f"  laps {_number(metrics['laps'])}, perimeter visited "
        f"{_number(metrics['perimeter_share'], 100, '%')}, heading error "
        f"{_number(metrics['heading_error'], 57.29578, 'deg')}, turn change "
        f"{_number(metrics['turn_change'], 1, 'rad/s^2')}"
    )


def _number(value: float | None, scale: float = 1, unit: str = "") -> str:
    return "none" if value is None else f"{value * scale:.2f} {unit}".rstrip()


if __name__ == "__main__":
    main(evaluate)
