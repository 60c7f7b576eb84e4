"""The folder of the gap: tests of policies in worlds, and the files about them."""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from epuck_mj.host.files import write_text, writing
from evolution.gap.figure import gap_figure
from evolution.gap.gap_document import gap_document, gap_summary
from evolution.gap.groups import experiments, labels, peers
from evolution.gap.outcomes import Outcome, ideal, in_worlds
from evolution.gap.transfer import Gap, Transfer, verdict
from evolution.gap.worlds import World, worlds
from evolution.named_policies import NamedPolicy
from evolution.pages.blocks import to_markdown
from evolution.pages.figure_files import write_figure
from evolution.study.table_files import write_rows

Places = Mapping[str, Sequence[World]]
"""Worlds by their kind."""

Measured = dict[str, tuple[list[Outcome], list[list[Outcome]], list[list[Outcome]]]]
"""For each kind of worlds, outcomes in nominal conditions, on ideal robots in each
world's arena, and in each world."""


def write_gap(
    folder: Path,
    policies: Sequence[NamedPolicy],
    robots: Sequence[str],
    kinds: Sequence[str],
    n_worlds: int,
    starts: int,
    threads: int,
) -> None:
    """Measure policies in worlds and write the results.

    Args:
        folder: an existing one.
        policies: who is tested.
        robots: that drive.
        kinds: of worlds, names in `KINDS`; the first counts most.
        n_worlds: how many of each kind.
        starts: test starts in each world, and in nominal conditions.
        threads: threads that step the robots; 0 is one per core.

    Raises:
        UserError: if a robot or an arena cannot be used, or a file not be written.
    """
    places = {kind: worlds(n_worlds, kind) for kind in kinds}
    measured = {
        robot: _measured(policies, places, robot, starts, threads) for robot in robots
    }
    _write(folder, policies, places, measured, starts)


def _measured(
    policies: Sequence[NamedPolicy],
    places: Places,
    robot: str,
    n: int,
    threads: int,
) -> Measured:
    nominal = ideal(policies, robot, n, threads)
    everywhere = [place for each in places.values() for place in each]
    arenas = {
        arena: ideal(policies, robot, n, threads, arena)
        for arena in dict.fromkeys(place.arena for place in everywhere)
    }
    bar = tqdm(
        in_worlds(policies, everywhere, robot, n, threads),
        total=len(everywhere),
        unit="world",
        desc=robot,
        disable=not sys.stderr.isatty(),
    )
    outcomes = iter(bar)
    return {
        kind: (
            nominal,
            [arenas[place.arena] for place in each],
            list(islice(outcomes, len(each))),
        )
        for kind, each in places.items()
    }


def _write(
    folder: Path,
    policies: Sequence[NamedPolicy],
    places: Places,
    measured: Mapping[str, Measured],
    starts: int,
) -> None:
    gaps = [
        Gap(
            kind=kind,
            names=[policy.name for policy in policies],
            transfers={
                robot: Transfer.of(*outcomes[kind])
                for robot, outcomes in measured.items()
            },
            groups=experiments(policies),
            peers=peers(policies),
            starts=starts,
            latency=np.array([place.latency for place in own]),
        )
        for kind, own in places.items()
    ]
    with writing():
        write_text(folder / "gap.json", json.dumps(_record(places, gaps)) + "\n")
        write_rows(folder / "gap.parquet", _rows(places, gaps))
        write_text(folder / "gap.md", to_markdown(gap_document(gaps)))
        write_text(folder / "summary.md", to_markdown([gap_summary(gaps)]))
    names = labels(policies, gaps[0].groups)
    write_figure(gap_figure(gaps, names), folder, "gap")


def _record(places: Places, gaps: Sequence[Gap]) -> dict[str, Any]:
    """What gap.json holds: the worlds, and a summary of each policy in each kind."""
    first = gaps[0]
    return {
        "starts": first.starts,
        "worlds": {
            kind: [asdict(world) for world in own] for kind, own in places.items()
        },
        "robots": {
            robot: {
                gap.kind: {
                    name: asdict(verdict(gap.transfers[robot], i))
                    for i, name in enumerate(gap.names)
                }
                for gap in gaps
            }
            for robot in first.transfers
        },
    }


def _rows(places: Places, gaps: Sequence[Gap]) -> list[dict[str, Any]]:
    """Rows of gap.parquet, one per kind of worlds, robot, policy and world.

    What a world is like is in gap.json.
    """
    return [
        {
            "robot": robot,
            "policy": name,
            "fitness": float(transfer.fitness[j, i]),
            "reference": float(transfer.reference[j, i]),
            "crash_rate": float(transfer.crash_rate[j, i]),
            "collisions_per_minute": float(transfer.collisions[j, i]),
            "kind": world.kind,
            "number": world.number,
            "arena": world.arena,
        }
        for gap in gaps
        for robot, transfer in gap.transfers.items()
        for i, name in enumerate(gap.names)
        for j, world in enumerate(places[gap.kind])
    ]
