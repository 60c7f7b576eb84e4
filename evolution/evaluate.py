"""Held-out evaluation: `python -m evolution.evaluate PATH... [options]`."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.host import files
from epuck_mj.host.command_line import (
    check_ending,
    check_threads,
    main,
    parse,
    word,
)
from epuck_mj.host.limits import check_flag
from epuck_mj.step.condition_flags import ConditionFlags
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.disturbances import Disturbances
from evolution.judging.held_out_starts import held_out_disturbances
from evolution.judging.scores import HeldOut
from evolution.named_policies import policies_of
from evolution.settings.config_fields import N_TEST
from evolution.settings.randomness import Purpose
from evolution.settings.setting import Setting

MODULE = "evolution.evaluate"


EXAMPLES = (
    "python -m evolution.evaluate runs/ga-seed-1 wall-follower",
    "python -m evolution.evaluate runs/ga-seed-1 --arena round --starts 100",
)


@dataclass(frozen=True)
class Options:
    """Test champions on starts that evolution never used, and report their behaviour.

    Attributes:
        paths: run or study directories, controller files, or wall-follower, the
            hand-written controller.
        generations: test the best individuals of these generations instead of the
            champions: numbers from 0 on, or last, separated by commas.
        starts: number of test starts; always the first of the same sequence.
        robot: robot to test on; if not given, the one that the champion evolved on,
            kinematic and on wheels; of an MJCF of your own, that robot and epuck.
        arena: arena to test in; if not given, the one that the champion evolved in.
        robots: noise and differences of the robots; ideal robots if not given.
        threads: threads that step the robots; 0 is one per core. Changes no result.
        json: JSON file to write all results to.
    """

    paths: tyro.conf.Positional[Annotated[tuple[str, ...], word("RUN")]]
    generations: Annotated[str | None, word("NUMBERS")] = None
    starts: int = N_TEST
    robot: Annotated[str | None, word("ROBOT")] = None
    arena: Annotated[str | None, word("ARENA")] = None
    robots: ConditionFlags = field(default_factory=ConditionFlags)
    threads: int = 0
    json: Annotated[Path | None, word("FILE")] = None


def evaluate_policies(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    check_flag("starts", options.starts)
    check_threads(options.threads)
    check_ending("json", options.json, ".json")
    candidates = policies_of(options.paths, options.generations)
    conditions = options.robots.conditions or Conditions()
    if options.json is not None:
        files.check_writable(options.json)
    # simulators are slow to import: after the checks of the command line
    from evolution.judging.held_out import Judges, tested_on

    judges = Judges(options.threads)

    @cache
    def met(steps: int) -> Disturbances | None:
        return held_out_disturbances(conditions, Purpose.TEST, options.starts, steps)

    tests = []
    for candidate in candidates:
        robots = [options.robot] if options.robot else tested_on(candidate.robot)
        arena = options.arena or candidate.arena
        setting = Setting(arena, candidate.task, candidate.start_clearance)
        for robot in robots:
            refusal = None if options.robot else judges.refusal(robot, setting)
            if refusal is not None:
                print(f"{candidate.name}: {refusal}", file=sys.stderr)
                continue
            steps = candidate.task.steps
            test = judges.of(robot, setting).test(
                candidate.policy, options.starts, met(steps)
            )
            print(f"{candidate.name}, {Path(robot).name} in {Path(arena).name}")
            print(_described(test, candidate.task.most), flush=True)
            where = {"name": candidate.name, "robot": robot, "arena": arena}
            tests.append(where | asdict(conditions) | test.to_dict())
    if options.json is not None:
        with files.writing():
            files.write_text(options.json, json.dumps(tests, indent=1) + "\n")
    return 0


def _described(test: HeldOut, most: float | None) -> str:
    """Indented lines with the scores of a policy."""
    of = "" if most is None else f" of {most:g}"
    low, high = test.interval
    metrics = test.metrics
    shares = sorted(test.behaviour.items(), key=lambda item: -item[1])
    did = ", ".join(f"{name} {share:.1%}" for name, share in shares if share > 0)
    return (
        f"  fitness{of}: mean {test.mean:.1f} (95 % CI {low:.1f} to "
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
    main(evaluate_policies)
