"""Numbers of a report as a person reads them, and what may be said of them."""

import math
import shlex
from collections.abc import Sequence

import numpy as np

from evolution.statistics import quartiles

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
