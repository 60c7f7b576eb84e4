"""Experiments held against each other, pair by pair, and what may be said of a pair.

P values are Holm-adjusted. The family is all pairs of experiments within one measure:
each such table is a question of its own.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from evolution.pages.words import between, probability
from evolution.report.tables import generator, measures
from evolution.statistics.comparisons import (
    FEWEST_FOR_STARS,
    LEVELS,
    a12_interval,
    holm,
    mann_whitney,
    median_difference,
    stars,
)
from evolution.statistics.samples import FEWEST_FOR_INTERVAL, Interval
from evolution.study.data import StudyData


@dataclass(frozen=True)
class PairRow:
    """Two experiments in one measure.

    Attributes:
        measure: "best stored", or "held-out" and the robot.
        a: name of the first experiment.
        b: name of the second.
        n_a: runs of the first.
        n_b: runs of the second.
        median_a: of the first.
        median_b: of the second.
        u: Mann-Whitney's, of the first.
        p: two-sided.
        method: exact or asymptotic.
        p_holm: adjusted for the family.
        family: tests in it.
        a12: probability that a run of the first exceeds one of the second.
        a12_low: 95 % bound, nan if either has fewer than 5 runs.
        a12_high: likewise.
        median_difference: first minus second.
        median_difference_low: bootstrap 95 % bound, likewise.
        median_difference_high: likewise.
        stars: of `p_holm`; none below 10 runs.
    """

    measure: str
    a: str
    b: str
    n_a: int
    n_b: int
    median_a: float
    median_b: float
    u: float
    p: float
    method: str
    p_holm: float
    family: int
    a12: float
    a12_low: float
    a12_high: float
    median_difference: float
    median_difference_low: float
    median_difference_high: float
    stars: str

    @property
    def enough(self) -> bool:
        """Whether there are runs enough for a verdict."""
        return min(self.n_a, self.n_b) >= FEWEST_FOR_STARS

    @property
    def decided(self) -> bool:
        """Whether they say which experiment is better."""
        return self.enough and self.p_holm < LEVELS[0]


def pair_rows(data: StudyData) -> list[PairRow]:
    """A row per measure and pair of like experiments, in the study's order."""
    return [
        row
        for measure, samples in measures(data).items()
        for row in pairs_of(measure, samples, data.alike)
    ]


def pairs_of(
    measure: str, samples: Mapping[str, np.ndarray], alike: Callable[[str, str], bool]
) -> list[PairRow]:
    """The same within one measure.

    Args:
        measure: its name.
        samples: of each experiment, `(runs,)`, none of them empty.
        alike: whether two experiments can be compared.
    """
    pairs = [pair for pair in combinations(samples, 2) if alike(*pair)]
    if not pairs:
        return []
    tests = [mann_whitney(samples[a], samples[b]) for a, b in pairs]
    adjusted = holm(np.array([test.p for test in tests])).tolist()
    rows = []
    for (a, b), test, p in zip(pairs, tests, adjusted, strict=True):
        one, other = samples[a], samples[b]
        effect, shift = _effect(one, other), median_difference(one, other, generator())
        rows.append(
            PairRow(
                measure=measure,
                a=a,
                b=b,
                n_a=one.size,
                n_b=other.size,
                median_a=float(np.median(one)),
                median_b=float(np.median(other)),
                u=test.u,
                p=test.p,
                method="exact" if test.exact else "asymptotic",
                p_holm=p,
                family=len(pairs),
                a12=effect.value,
                a12_low=effect.low,
                a12_high=effect.high,
                median_difference=shift.value,
                median_difference_low=shift.low,
                median_difference_high=shift.high,
                stars=stars(p, min(one.size, other.size)),
            )
        )
    return rows


def _effect(a: np.ndarray, b: np.ndarray) -> Interval:
    """A12, without an interval of few runs."""
    effect = a12_interval(a, b)
    if min(a.size, b.size) < FEWEST_FOR_INTERVAL:
        return Interval(effect.value, math.nan, math.nan)
    return effect


def numbers(row: PairRow) -> str:
    """A pair of experiments in numbers."""
    return (
        f"medians {row.median_a:.1f} and {row.median_b:.1f}, difference "
        f"{row.median_difference:z.1f} "
        + between(row.median_difference_low, row.median_difference_high, ".1f")
        + f"; A12 {row.a12:.2f} {between(row.a12_low, row.a12_high)}; "
        f"p {probability(row.p)}, Holm {probability(row.p_holm)}"
    )


def compared(row: PairRow, a: str, b: str) -> str:
    """What a pair of experiments shows, and no more; the better one comes first.

    Args:
        row: the pair.
        a: name of the first for readers.
        b: name of the second.
    """
    if row.a12 < 0.5:
        row, a, b = _turned(row), b, a
    found = f"{numbers(row)}; n = {row.n_a} and {row.n_b}"
    if not row.enough:
        return (
            f"{a} and {b}: {found}. Fewer than {FEWEST_FOR_STARS} runs: "
            "no verdict on which is better."
        )
    if not row.decided:
        return (
            f"{a} and {b}: no difference is shown, which does not show that there is "
            f"none: {found}."
        )
    return f"{a} beats {b} in {row.a12:.0%} of the pairs of runs: {found}."


def _turned(row: PairRow) -> PairRow:
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
