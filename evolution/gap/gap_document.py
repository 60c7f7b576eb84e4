"""Document about the gap: fitness and crashes in worlds, what is kept, and ranks."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from evolution.gap.transfer import (
    COLLISIONS_MAX,
    SHARE_KEPT,
    Gap,
    Transfer,
    Verdict,
    between_robots,
    rank_correlations,
    verdict,
)
from evolution.gap.worlds import KINDS
from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table

COLUMNS = (
    *("experiment", "policy", "fitness", "trials that crash", "nominal fitness"),
    *("kept, mean", "kept, median", "collisions per minute", "worlds mastered"),
)
KEPT_COLUMNS = (
    *("experiment", "robot", "n", "nominal fitness", "kept"),
    *("collisions per minute", "worlds mastered", "against nominal"),
)


def gap_summary(gaps: Sequence[Gap]) -> Table:
    """Table with a row per experiment and robot: fitness and crashes in the worlds.

    Medians over an experiment's policies of their means.

    Args:
        gaps: of the same policies in worlds of each kind; the first counts most.
    """
    first = gaps[0]
    rows = []
    for group, members in first.groups.items():
        speeds = [s for s, each in first.peers.items() if set(each) & set(members)]
        for robot, transfer in first.transfers.items():
            there = [_there(gap.transfers[robot], members) for gap in gaps]
            own = transfer.nominal[members], transfer.share[:, members].mean(axis=0)
            nominal, kept = (float(np.median(each)) for each in own)
            n = str(len(members))
            speed = ", ".join(speeds)
            rows.append(
                [group, speed, robot, n, *there, f"{nominal:.3f}", f"{kept:.0%}"]
            )
    titles = (KINDS[gap.kind].title for gap in gaps)
    columns = ("experiment", "full speed", "robot", "n", *titles, "nominal", "kept")
    return Table(columns, rows, texts=3)


def _there(transfer: Transfer, members: Sequence[int], worlds: Any = ...) -> str:
    """Fitness and share of crashes of policies in some worlds: `0.352, 7.1%`."""
    fitness, crashes = (
        float(np.median(values[worlds][:, members].mean(axis=0)))
        for values in (transfer.fitness, transfer.crash_rate)
    )
    return f"{fitness:.3f}, {crashes:.1%}"


def kept_table(gap: Gap) -> Table:
    """Table of shares kept with a row per experiment and robot, as `gap_summary`."""
    rows = []
    for group, members in gap.groups.items():
        for robot, transfer in gap.transfers.items():
            share, collisions, mastered, against_nominal = (
                float(np.median(values[:, members].mean(axis=0)))
                for values in (
                    transfer.share,
                    transfer.collisions,
                    transfer.mastered,
                    transfer.mastered_against_nominal,
                )
            )
            nominal = float(np.median(transfer.nominal[members]))
            cells = [group, robot, str(len(members)), f"{nominal:.3f}", f"{share:.0%}"]
            shares = [f"{mastered:.0%}", f"{against_nominal:.0%}"]
            rows.append([*cells, f"{collisions:.1f}", *shares])
    return Table(KEPT_COLUMNS, rows, texts=2)


def by_latency(gap: Gap) -> Table:
    """Table of fitness and crashes by latency, with a row per experiment and robot."""
    late = np.unique(gap.latency)
    rows = []
    for group, members in gap.groups.items():
        for robot, transfer in gap.transfers.items():
            there = (_there(transfer, members, gap.latency == n) for n in late)
            rows.append([group, robot, str(len(members)), *there])
    return Table(("experiment", "robot", "n", *map(str, late)), rows, texts=2)


def gap_document(gaps: Sequence[Gap]) -> list[Block]:
    """Blocks of the document about the gap, in worlds of each kind."""
    first = gaps[0]
    title = KINDS[first.kind].title
    blocks: list[Block] = [
        Heading("The reality gap", 1),
        Paragraph(
            f"{len(first.names)} policies, unchanged, in {first.latency.size} worlds "
            f"of each kind, drawn as a Latin hypercube, on {first.starts} starts, "
            "which differ from world to world. In each column: mean step fitness, and "
            "the share of the trials that end in a crash. The nominal fitness is "
            "that with ideal sensors and motors, in the arena that a policy evolved "
            "in, from as many test starts. Kept is the fitness in the first column's "
            "worlds as a share of a reference (see What is kept)."
        ),
        gap_summary(gaps),
        Paragraph(
            "Each number is the median over the policies of an experiment of their "
            "means. " + " ".join(KINDS[gap.kind].about for gap in gaps)
        ),
        Heading("Latency"),
        Paragraph(
            f"Worlds: {title}. Fitness and crashes by how many control steps late "
            "commands reach the wheels."
        ),
        by_latency(first),
        Heading("What is kept"),
        Paragraph(
            f"Worlds: {title}. Kept is the fitness in the world as a share of a "
            "reference: the nominal fitness, or the fitness of an ideal robot in the "
            "world's arena if that is higher (in a smaller arena, robots find walls "
            "sooner). A slow policy has little to lose. A policy masters a world if it "
            f"keeps at least {SHARE_KEPT:.0%} and has fewer than {COLLISIONS_MAX:g} "
            "collision per minute. Against nominal: worlds mastered if the reference "
            "is always the nominal fitness."
        ),
        kept_table(first),
        Paragraph(
            "Below, every policy. In brackets, 95 % intervals over the worlds and "
            "their starts."
        ),
    ]
    for gap in gaps:
        for robot, transfer in gap.transfers.items():
            rows = [
                [group, gap.names[i], *_cells(verdict(transfer, i))]
                for group, members in gap.groups.items()
                for i in members
            ]
            heading = Heading(f"{robot}, {KINDS[gap.kind].title}")
            blocks += [heading, Table(COLUMNS, rows, texts=2)]
    return [*blocks, *_ranks(first)]


def _ranks(gap: Gap) -> list[Block]:
    """Rank correlations in words; no block if there are too few policies."""
    items = []
    for speed, members in gap.peers.items():
        for robot, transfer in gap.transfers.items():
            found = rank_correlations(transfer, members)
            if found is not None:
                items.append(
                    f"{len(members)} policies of {speed}, {robot}: between nominal "
                    "fitness and a world, mean over the worlds, "
                    f"{found['nominal']:.2f}; between two worlds, mean over all pairs, "
                    f"{found['worlds']:.2f}"
                )
        if len(gap.transfers) == 2:
            one, other = gap.transfers.values()
            agreed = between_robots(one, other, members)
            if agreed is not None:
                items.append(
                    f"{len(members)} policies of {speed}: between the two robots, by "
                    f"mean fitness over the worlds, {agreed:.2f}"
                )
    if not items:
        return []
    return [
        Heading("Ranks"),
        Paragraph(
            "Rank correlations (Spearman) of fitness, among policies with the same "
            "full speed only: slower policies have less nominal fitness and "
            "keep more of it in every world."
        ),
        Listing(items),
    ]


def _cells(found: Verdict) -> list[str]:
    fitness, crashes, share = found.fitness, found.crash_rate, found.share
    collisions, mastered = found.collisions, found.mastered
    return [
        f"{fitness.value:.3f} [{fitness.low:.3f}, {fitness.high:.3f}]",
        f"{crashes.value:.1%} [{crashes.low:.1%}, {crashes.high:.1%}]",
        f"{found.nominal:.3f}",
        f"{share.value:.2f} [{share.low:.2f}, {share.high:.2f}]",
        f"{found.median_share:.2f}",
        f"{collisions.value:.1f} [{collisions.low:.1f}, {collisions.high:.1f}]",
        f"{mastered.value:.0%} [{mastered.low:.0%}, {mastered.high:.0%}]",
    ]
