"""Numbers of a report as a person reads them, and what may be said of them."""

import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from evolution.comparisons import FEWEST_FOR_STARS, LEVELS
from evolution.statistics import quartiles

if TYPE_CHECKING:
    # it counts on the claims, which are written in these words
    from evolution.report.comparisons import PairRow

NOTHING = "-"
"""Stands for what is not known."""


def spread(sample: np.ndarray, scale: float = 1.0, form: str = ".1f") -> str:
    """Median and quartiles of `(n,)`; the value alone of one run."""
    if not sample.size:
        return NOTHING
    if sample.size == 1:
        return f"{sample[0] * scale:{form}} (n = 1)"
    found = quartiles(sample * scale)
    return f"{found.median:{form}} [{found.lower:{form}}, {found.upper:{form}}]"


def between(low: float, high: float, form: str = ".2f") -> str:
    """An interval, or that there is none."""
    if math.isnan(low) or math.isnan(high):
        return "(n = 1, no interval)"
    return f"[{low:{form}}, {high:{form}}]"


def percent(share: float | None) -> str:
    """A share in percent."""
    return NOTHING if share is None else f"{share:.1%}"


def probability(p: float) -> str:
    """A p value with its sign of equality."""
    return "< 0.001" if p < 0.001 else f"= {p:.3f}"


def evaluations(n: float | None) -> str:
    """A number of evaluations."""
    if n is None or math.isnan(n):
        return NOTHING
    return "never" if math.isinf(n) else f"{n:,.0f}"


def seeds_text(seeds: Sequence[int]) -> str:
    """Ascending seeds as the command line takes them: 1-3,7."""
    groups: list[list[int]] = []
    for seed in seeds:
        if groups and seed == groups[-1][-1] + 1:
            groups[-1].append(seed)
        else:
            groups.append([seed])
    return ",".join(
        str(group[0]) if len(group) == 1 else f"{group[0]}-{group[-1]}"
        for group in groups
    )


def command_line(module: str, *arguments: str) -> str:
    """The line that runs a module of ours, the same wherever the report is made."""
    return shlex.join(["python", "-m", module, *arguments])


def compared(row: "PairRow", a: str, b: str) -> str:
    """What a pair of experiments shows, and no more; the better one comes first.

    Args:
        row: the pair.
        a: name of the first for readers.
        b: name of the second.
    """
    if row.a12 < 0.5:
        row, a, b = _turned(row), b, a
    numbers = (
        f"medians {row.median_a:.1f} and {row.median_b:.1f}, difference "
        f"{row.median_difference:.1f} "
        + between(row.median_difference_low, row.median_difference_high, ".1f")
        + f"; A12 {row.a12:.2f} {between(row.a12_low, row.a12_high)}; "
        f"p {probability(row.p)}, Holm {probability(row.p_holm)}; "
        f"n = {row.n_a} and {row.n_b}"
    )
    if min(row.n_a, row.n_b) < FEWEST_FOR_STARS:
        return (
            f"{a} and {b}: {numbers}. Fewer than {FEWEST_FOR_STARS} runs: "
            "no verdict on which is better."
        )
    if row.p_holm >= LEVELS[0]:
        return (
            f"{a} and {b}: no difference is shown, which does not show that there is "
            f"none: {numbers}."
        )
    return f"{a} beats {b} in {row.a12:.0%} of the pairs of runs: {numbers}."


def _turned(row: "PairRow") -> "PairRow":
    """The same pair, the second experiment first."""
    return replace(
        row,
        a=row.b,
        b=row.a,
        n_a=row.n_b,
        n_b=row.n_a,
        median_a=row.median_b,
        median_b=row.median_a,
        u=row.n_a * row.n_b - row.u,
        a12=1 - row.a12,
        a12_low=1 - row.a12_high,
        a12_high=1 - row.a12_low,
        median_difference=-row.median_difference,
        median_difference_low=-row.median_difference_high,
        median_difference_high=-row.median_difference_low,
    )
