"""The folder of the gap: tests of policies in worlds, and the files about them."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from tqdm import tqdm

from epuck_mj.host.files import write_text, writing
from evolution.gap.figure import kept_figure
from evolution.gap.gap_document import gap_document, gap_summary
from evolution.gap.groups import experiments, labels, peers
from evolution.gap.outcomes import Outcome, abroad, ideal
from evolution.gap.transfer import Gap, Transfer, verdict
from evolution.gap.worlds import World, worlds
from evolution.named_policies import NamedPolicy
from evolution.pages.blocks import to_markdown
from evolution.pages.csv_text import csv_text
from evolution.pages.figure_files import write_figure

Measured = tuple[list[Outcome], list[list[Outcome]], list[list[Outcome]]]
"""Outcomes at home, on ideal robots in each world's arena, and in each world."""


def write_gap(
    folder: Path,
    policies: Sequence[NamedPolicy],
    robots: Sequence[str],
    n_worlds: int,
    starts: int,
    threads: int,
) -> None:
    """Measure policies in worlds and write the results.

    Args:
        folder: an existing one.
        policies: who is tested.
        robots: that drive.
        n_worlds: how many.
        starts: test starts in each world, and at home.
        threads: threads that step the robots; 0 is one per core.

    Raises:
        UserError: if a robot or an arena cannot be used, or a file not be written.
    """
    places = worlds(n_worlds)
    measured = {
        robot: _measured(policies, places, robot, starts, threads) for robot in robots
    }
    _write(folder, policies, places, measured, starts)


def _measured(
    policies: Sequence[NamedPolicy],
    places: Sequence[World],
    robot: str,
    n: int,
    threads: int,
) -> Measured:
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
    starts: int,
) -> None:
    transfers = {robot: Transfer.of(*outcomes) for robot, outcomes in measured.items()}
    gap = Gap(
        names=[policy.name for policy in policies],
        transfers=transfers,
        groups=experiments(policies),
        peers=peers(policies),
        starts=starts,
        latency=np.array([place.latency for place in places]),
    )
    record = {
        "worlds": [asdict(world) for world in places],
        "starts": starts,
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
        write_text(folder / "gap.md", to_markdown(gap_document(gap)))
        write_text(folder / "summary.md", to_markdown([gap_summary(gap)]))
    names = labels(policies, gap.groups)
    write_figure(kept_figure(gap, names), folder, "gap")


def _rows(
    policies: Sequence[NamedPolicy],
    places: Sequence[World],
    transfers: dict[str, Transfer],
) -> str:
    """Rows of gap.csv, one per robot, policy and world."""
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
