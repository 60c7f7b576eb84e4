"""Champions in other worlds: `python -m evolution.gap PATH... --output FOLDER`."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import check_threads, main, parse, word
from epuck_mj.host.files import check_writable, writing
from epuck_mj.host.limits import check_flag
from epuck_mj.scene.model_files import without_physics
from evolution.gap.slowed import with_slowed
from evolution.named_policies import common_wheels, policies_of

EXAMPLES = (
    "python -m evolution.gap results/paper --output gap",
    "python -m evolution.gap runs/a runs/b --output gap --worlds 20",
    "python -m evolution.gap results/paper wall-follower --output gap --speeds 0.04",
    "python -m evolution.gap runs/a --output gap --kinds calibrated-gains",
)


@dataclass(frozen=True)
class GapOptions:
    """Drive champions in worlds that differ from the one they evolved in.

    Attributes:
        paths: run or study directories, controller files, or wall-follower.
        output: folder for gap.md, summary.md, gap.json, gap.parquet and figures.
        kinds: kinds of worlds: usual, beyond, corners, calibrated-gains; all if not
            given. Shares kept, latencies and ranks are those of the first kind given.
        worlds: number of worlds of each kind.
        starts: number of test starts in each world and in the arena of evolution.
        robot: robot that drives; if not given, the one that all evolved on, kinematic
            and on wheels, or else epuck_kinematic and epuck.
        speeds: drive every policy at these full speeds, too, if it is faster [m/s].
        threads: threads that step the robots; 0 is one per core. Changes no result.
    """

    paths: tyro.conf.Positional[Annotated[tuple[str, ...], word("RUN")]]
    output: Annotated[Path, word("FOLDER")]
    kinds: Annotated[tuple[str, ...], word("KIND")] = ()
    worlds: int = 100
    starts: int = 20
    robot: Annotated[str | None, word("ROBOT")] = None
    speeds: tuple[float, ...] = ()
    threads: int = 0


def measure_gap(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(GapOptions, "python -m evolution.gap", argv, examples=EXAMPLES)
    check_flag("worlds", options.worlds)
    check_flag("starts", options.starts, "worlds")
    for speed in options.speeds:
        check_flag("speeds", speed, "v_max")
    check_threads(options.threads)
    kinds = _kinds(options.kinds)
    policies = with_slowed(policies_of(dict.fromkeys(options.paths)), options.speeds)
    wheels = common_wheels(policies)
    kinematic = without_physics(wheels)
    robots = [options.robot] if options.robot else [kinematic, wheels]
    # slow to import
    from evolution.gap.gap_folder import write_gap
    from evolution.gap.outcomes import check_nominal

    try:
        check_nominal(policies, robots)
    except UserError as problem:
        if options.robot:
            raise
        # on wheels only, if all arenas allow that
        robots = [wheels]
        check_nominal(policies, robots)
        print(f"not driven on {kinematic}: {problem}", file=sys.stderr)
    with writing():
        options.output.mkdir(parents=True, exist_ok=True)
    check_writable(options.output / "gap.md")
    write_gap(
        options.output,
        policies,
        robots,
        kinds,
        options.worlds,
        options.starts,
        options.threads,
    )
    print((options.output / "gap.md").read_text(encoding="utf-8"), end="")
    return 0


def _kinds(asked: Sequence[str]) -> tuple[str, ...]:
    """The kinds of worlds that are asked for, each once; all if none is.

    Raises:
        UserError: if there is no such kind.
    """
    # slow to import
    from evolution.gap.worlds import KINDS

    for kind in asked:
        if kind not in KINDS:
            available = ", ".join(KINDS)
            raise UserError(f"no kind of worlds '{kind}'; available: {available}")
    return tuple(dict.fromkeys(asked)) or tuple(KINDS)


if __name__ == "__main__":
    main(measure_gap)
