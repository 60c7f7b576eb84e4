"""The page of all variations: in which the paper's order comes back, and fitness."""

from collections.abc import Sequence

import numpy as np

from evolution.pages.blocks import Block, Heading, Paragraph, Picture, Table
from evolution.pages.words import (
    LABELS,
    NOTHING,
    PAPER_BEST,
    PAPERS,
    REPLICATES,
    numbered,
    probability,
    spread,
)
from evolution.statistics.significance import FEWEST_FOR_STARS
from evolution.variations.change_words import in_words
from evolution.variations.varied import UNCHANGED, Order, Varied


def variations_page(
    varied: Sequence[Varied], found: Sequence[Order], picture: Picture
) -> list[Block]:
    """The page's blocks."""
    changes = [each for each in varied if each.change != UNCHANGED]
    runs = sum(each.held_out.size for each in varied)
    return [
        Heading("Variations", 1),
        Paragraph(
            f"The paper's three algorithms with one thing changed at a time: "
            f"{numbered(len(changes), 'variation')}, {numbered(runs, 'run')} in all. "
            "Held-out fitness is the champion's mean on test starts on wheels. Best "
            "stored fitness is what the paper reports."
        ),
        picture,
        Heading("Does the paper's order come back?"),
        Paragraph(orders_text(found)),
        orders_table(found),
        Heading("Which may have given the paper's numbers?"),
        Paragraph(
            f"The paper reports the best of {REPLICATES} runs of each algorithm. A "
            "change is listed if the paper's number lies within our runs with it, and "
            f"may be the best of {REPLICATES} such runs (two-sided p of at least 0.05)."
        ),
        papers_table(varied),
        Heading("Every variation"),
        Paragraph(
            "Shift: Hodges-Lehmann estimate against the unchanged algorithm with a "
            "90 % interval. p: Mann-Whitney, Holm-adjusted for all variations of this "
            f"page. Below {FEWEST_FOR_STARS} runs there is no verdict, and none with "
            "another step fitness, which measures something else."
        ),
        *(_table(varied, algorithm) for algorithm in PAPERS),
    ]


def orders_text(found: Sequence[Order]) -> str:
    """In how many rows of the figure the paper's order comes back."""
    names = " > ".join(LABELS[name] for name in PAPERS)
    told = _told(found)
    return (
        f"The paper's order is {names} in best stored fitness. The probability that "
        f"the best of {REPLICATES} of our runs each have it is above 5 % in "
        f"{sum(order.possible for order in told)} of {len(told)} rows of the figure. "
        f"The medians have it in {sum(order.typical for order in told)}. An algorithm "
        "that a change does not concern is unchanged there."
    )


def orders_table(found: Sequence[Order]) -> Table:
    """Where the paper's order of best stored fitness comes back."""
    back = sorted(
        (order for order in _told(found) if order.possible or order.typical),
        key=lambda order: -order.chance,
    )
    return Table(
        (
            "changed",
            "in",
            "fewest runs",
            "probability of the order",
            *(f"best stored, {LABELS[name]}" for name in PAPERS),
            "order of medians",
        ),
        [
            (
                in_words(order.change),
                ", ".join(LABELS[name] for name in order.varied),
                str(order.fewest),
                f"{order.chance:.2g}",
                *(f"{median:.0f}" for median in order.medians),
                "the paper's" if order.typical else "another",
            )
            for order in back
        ],
        texts=2,
    )


def papers_table(varied: Sequence[Varied]) -> Table:
    """The changes with which each of the paper's numbers may have come about."""
    rows = []
    for algorithm in PAPERS:
        alike = [
            each
            for each in varied
            if each.algorithm == algorithm and each.may_be_papers
        ]
        told = sorted(alike, key=lambda each: -each.chance_of_papers)
        changes = [
            f"{in_words(each.change)} (p {each.chance_of_papers:.2g})" for each in told
        ]
        best = f"{PAPER_BEST[algorithm]:g}"
        rows.append((LABELS[algorithm], "; ".join(changes) or "none", best))
    return Table(("algorithm", "changes", "paper's best"), rows, texts=2)


def _told(found: Sequence[Order]) -> list[Order]:
    """Those with runs enough."""
    return [order for order in found if order.fewest >= FEWEST_FOR_STARS]


def _table(varied: Sequence[Varied], algorithm: str) -> Table:
    """All variations of one algorithm."""
    return Table(
        (
            LABELS[algorithm],
            *("runs", "of", "held-out on wheels", "crash", "best stored"),
            *("shift", "Holm p", "verdict"),
        ),
        [_row(each) for each in varied if each.algorithm == algorithm],
    )


def _row(each: Varied) -> tuple[str, ...]:
    shift, p = NOTHING, NOTHING
    if each.against is not None:
        shift = str(each.against)
        p = probability(each.p).removeprefix("= ")
    return (
        in_words(each.change),
        str(each.held_out.size),
        str(each.steps),
        spread(each.held_out),
        f"{np.median(each.crash_rate):.0%}",
        spread(each.stored),
        shift,
        p,
        _verdict(each),
    )


def _verdict(each: Varied) -> str:
    """What the runs say of a variation against the unchanged algorithm."""
    if each.against is None or not each.enough:
        return NOTHING
    return each.against.verdict(each.p)
