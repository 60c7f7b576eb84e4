"""The command line of the gap: who is tested, where, and what is written."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import tyro
from tqdm import tqdm

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import check_threads, main, parse
from epuck_mj.host.files import check_writable, write_text, writing
from epuck_mj.scene.model_files import PLANAR_ROBOT, WHEELED_ROBOT
from evolution.gap.gap_document import gap_document, gap_summary
from evolution.gap.groups import experiments, peers
from evolution.gap.outcomes import Outcome, abroad, ideal
from evolution.gap.transfer import Transfer, verdict
from evolution.gap.worlds import World, worlds
from evolution.named_policies import NamedPolicy, named_policies
from evolution.pages.blocks import to_markdown
from evolution.pages.csv_text import csv_text

NUMBER_MAX = 1000
"""Most worlds, and most starts in each."""


@dataclass(frozen=True)
class GapOptions:
    """Drive champions in worlds that differ from the one they evolved in.

    Attributes:
        paths: run or study directories, controller files, or wall-follower.
        output: folder to write gap.md, summary.md, gap.json, gap.csv and figures into.
        worlds: how many.
        starts: test starts in each world, and at home.
        robot: robot that drives; both shipped ones if not given.
        threads: threads that step the robots; 0 is one per core. Changes no result.
    """

    paths: tyro.conf.Positional[tuple[str, ...]]
    output: Path
    worlds: int = 100
    starts: int = 20
    robot: str | None = None
    threads: int = 0


def measure_gap(argv: Sequence[str]) -> int:
    """Run the command line; its exit status.

    Raises:
        UserError: for anything the user can put right.
    """
    options = parse(GapOptions, "python -m evolution.gap", argv)
    for name, value in (("worlds", options.worlds), ("starts", options.starts)):
        if not 2 <= value <= NUMBER_MAX:
            raise UserError(f"expected 2 to {NUMBER_MAX} {name}, got {value}")
    check_threads(options.threads)
    if not options.paths:
        raise UserError(
            "expected run or study directories, controller files, or wall-follower"
        )
    policies = [
        found for path in dict.fromkeys(options.paths) for found in named_policies(path)
    ]
    places = worlds(options.worlds)
    robots = [options.robot] if options.robot else [PLANAR_ROBOT, WHEELED_ROBOT]
    with writing():
        options.output.mkdir(parents=True, exist_ok=True)
    check_writable(options.output / "gap.md")
    measured = {robot: _measured(policies, places, robot, options) for robot in robots}
    _write(options.output, policies, places, measured, options)
    print((options.output / "gap.md").read_text(encoding="utf-8"), end="")
    return 0


Measured = tuple[list[Outcome], list[list[Outcome]], list[list[Outcome]]]
"""At home, as ideal robots in each world's arena, in each world; one per policy."""


def _measured(
    policies: Sequence[NamedPolicy],
    places: Sequence[World],
    robot: str,
    options: GapOptions,
) -> Measured:
    n, threads = options.starts, options.threads
    home = ideal(policies, robot, n, threads)
    arenas = {
        arena: ideal(policies, robot, n, threads, arena)
        for arena in dict.fromkeys(place.arena for place in places)
    }
    outcomes = abroad(policies, places, robot, n, threads)
    bar = tqdm(
        outcomes,
        total=len(places),
        unit="world",
        desc=robot,
        disable=not sys.stderr.isatty(),
    )
    return home, [arenas[place.arena] for place in places], list(bar)


def _write(
    folder: Path,
    policies: Sequence[NamedPolicy],
    places: Sequence[World],
    measured: dict[str, Measured],
    options: GapOptions,
) -> None:
    from evolution.gap.figure import kept_figure
    from evolution.pages.figure_files import write_figure

    transfers = {robot: Transfer.of(*outcomes) for robot, outcomes in measured.items()}
    groups = experiments(policies)
    record = {
        "worlds": [asdict(world) for world in places],
        "starts": options.starts,
        "robots": {
            robot: {
                policy.name: {
                    **asdict(verdict(transfers[robot], i)),
                    "ideal": [world[i].fitness for world in outcomes[1]],
                    "abroad": [asdict(world[i]) for world in outcomes[2]],
                }
                for i, policy in enumerate(policies)
            }
            for robot, outcomes in measured.items()
        },
    }
    with writing():
        write_text(folder / "gap.json", json.dumps(record, indent=1) + "\n")
        write_text(folder / "gap.csv", _rows(policies, places, transfers))
        names = [policy.name for policy in policies]
        latency = np.array([place.latency for place in places])
        alike = peers(policies)
        blocks = gap_document(names, transfers, groups, alike, options.starts, latency)
        write_text(folder / "gap.md", to_markdown(blocks))
        table = to_markdown([gap_summary(transfers, groups, alike)])
        write_text(folder / "summary.md", table)
    write_figure(kept_figure(transfers, groups), folder, "gap")


def _rows(
    policies: Sequence[NamedPolicy],
    places: Sequence[World],
    transfers: dict[str, Transfer],
) -> str:
    """A row per robot, policy and world."""
    rows = [
        {
            "robot": robot,
            "policy": policy.name,
            "world": j,
            "share": f"{transfer.share[j, i]:.4f}",
            "collisions_per_minute": f"{transfer.collisions[j, i]:.4f}",
            **asdict(world),
        }
        for robot, transfer in transfers.items()
        for i, policy in enumerate(policies)
        for j, world in enumerate(places)
    ]
    return csv_text(list(rows[0]), rows)


if __name__ == "__main__":
    main(measure_gap)
