"""Document about the gap: a table per robot, and rank correlations."""

import numpy as np

from evolution.gap.transfer import (
    COLLISIONS_MAX,
    SHARE_KEPT,
    Gap,
    Verdict,
    between_robots,
    rank_correlations,
    verdict,
)
from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table

COLUMNS = (
    *("experiment", "policy", "fitness at home", "kept, mean", "kept, median"),
    *("collisions per minute", "worlds mastered"),
)
GROUP_COLUMNS = (
    *("experiment", "full speed", "robot", "n", "fitness at home", "kept"),
    *("collisions per minute", "worlds mastered", "against home"),
)


def gap_summary(gap: Gap) -> Table:
    """Table with a row per experiment and robot: medians of its policies' means."""
    rows = []
    for group, members in gap.groups.items():
        speeds = [s for s, each in gap.peers.items() if set(each) & set(members)]
        for robot, transfer in gap.transfers.items():
            share, collisions, mastered, against_home = (
                float(np.median(values[:, members].mean(axis=0)))
                for values in (
                    transfer.share,
                    transfer.collisions,
                    transfer.mastered,
                    transfer.mastered_against_home,
                )
            )
            home = float(np.median(transfer.home[members]))
            rows.append(
                [
                    *(
                        group,
                        ", ".join(speeds),
                        robot,
                        str(len(members)),
                        f"{home:.3f}",
                    ),
                    *(f"{share:.0%}", f"{collisions:.1f}"),
                    *(f"{mastered:.0%}", f"{against_home:.0%}"),
                ]
            )
    return Table(GROUP_COLUMNS, rows, texts=3)


def by_latency(gap: Gap) -> Table:
    """Table of mean shares kept by latency, with a row per experiment and robot."""
    late = np.unique(gap.latency)
    rows = []
    for group, members in gap.groups.items():
        for robot, transfer in gap.transfers.items():
            kept = [transfer.share[gap.latency == n][:, members].mean() for n in late]
            shares = (f"{share:.0%}" for share in kept)
            rows.append([group, robot, str(len(members)), *shares])
    return Table(("experiment", "robot", "n", *map(str, late)), rows, texts=2)


def gap_document(gap: Gap) -> list[Block]:
    """Blocks of the document about the gap."""
    blocks: list[Block] = [
        Heading("The reality gap", 1),
        Paragraph(
            f"{len(gap.names)} policies, unchanged, in {gap.latency.size} worlds of a "
            f"Latin hypercube, on the first {gap.starts} test starts. Home is the "
            "arena they evolved in, with ideal sensors and motors and as many starts. "
            f"A policy masters a world if it keeps at least {SHARE_KEPT:.0%} of its "
            f"fitness and has fewer than {COLLISIONS_MAX:g} collision per minute. "
            "Kept is the fitness in the world as a share of a reference: the fitness "
            "at home, or the fitness of an ideal robot in that world's arena if that "
            "is higher (in a smaller arena, robots find walls sooner). Against home: "
            "worlds mastered if the reference is always the fitness at home. In "
            "brackets: 95 % intervals over the worlds. They do not include the spread "
            "over starts, which are the same in every world."
        ),
        gap_summary(gap),
        Paragraph(
            "Each number is the median over the policies of an experiment of their "
            "means. Worlds have the same ranges of wheel radius, track, mass, friction "
            "and latency as the randomised robots of evolution: policies that evolved "
            "on randomised robots have met such differences before."
        ),
        Heading("Latency"),
        Paragraph(
            "Share kept in the worlds where commands reach the wheels this many "
            "control steps late, mean over worlds and policies."
        ),
        by_latency(gap),
    ]
    for robot, transfer in gap.transfers.items():
        rows = [
            [group, gap.names[i], *_cells(verdict(transfer, i))]
            for group, members in gap.groups.items()
            for i in members
        ]
        blocks += [Heading(robot), Table(COLUMNS, rows, texts=2)]
    return [*blocks, *_ranks(gap)]


def _ranks(gap: Gap) -> list[Block]:
    """Rank correlations in words; no block if there are too few policies."""
    items = []
    for speed, members in gap.peers.items():
        for robot, transfer in gap.transfers.items():
            found = rank_correlations(transfer, members)
            if found is not None:
                items.append(
                    f"{len(members)} policies of {speed}, {robot}: between home and a "
                    f"world, mean over the worlds, {found['home']:.2f}; between two "
                    f"worlds, mean over all pairs, {found['worlds']:.2f}"
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
            "full speed only: slower policies earn less at home and keep more of it "
            "in every world."
        ),
        Listing(items),
    ]


def _cells(found: Verdict) -> list[str]:
    share, collisions, mastered = found.share, found.collisions, found.mastered
    return [
        f"{found.home:.3f}",
        f"{share.value:.2f} [{share.low:.2f}, {share.high:.2f}]",
        f"{found.median_share:.2f}",
        f"{collisions.value:.1f} [{collisions.low:.1f}, {collisions.high:.1f}]",
        f"{mastered.value:.0%} [{mastered.low:.0%}, {mastered.high:.0%}]",
    ]
