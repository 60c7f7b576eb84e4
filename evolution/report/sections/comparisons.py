"""Comparisons: each pair of experiments by the Mann-Whitney test."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table
from evolution.pages.words import between, label, probability, robot_name
from evolution.report.contests import COMPARED_PAIRWISE, Contest, contests
from evolution.report.measures import (
    generator,
    held_out_measure,
    measure_title,
    measures,
    shown_robots,
)
from evolution.statistics.effect_sizes import a12_interval, median_difference
from evolution.statistics.equivalence import Equivalence, equivalence
from evolution.statistics.estimates import FEWEST_FOR_INTERVAL, Interval
from evolution.statistics.significance import (
    FEWEST_FOR_STARS,
    LEVELS,
    mann_whitney,
    stars,
)
from evolution.study.data import StudyData


@dataclass(frozen=True, eq=False)
class Comparison(Contest):
    """Two experiments compared in one measure.

    Attributes:
        a12: probability that a run of the first exceeds one of the second; without
            bounds below 5 runs.
        shift: median of the first minus that of the second.
        equivalence: test that the two differ by less than the margin.
        p_equivalence: of this test, adjusted for the family.
    """

    a12: Interval
    shift: Interval
    equivalence: Equivalence
    p_equivalence: float

    @property
    def equivalent(self) -> bool:
        """Whether the runs show that the two differ by less than the margin."""
        return self.enough and self.p_equivalence < LEVELS[0]

    def turned(self) -> Self:
        """This comparison, the second experiment first."""
        a12, shift = self.a12, self.shift
        return replace(
            self,
            a=self.b,
            b=self.a,
            of_a=self.of_b,
            of_b=self.of_a,
            a12=Interval(1 - a12.value, 1 - a12.high, 1 - a12.low),
            shift=Interval(-shift.value, -shift.high, -shift.low),
            equivalence=self.equivalence.turned(),
        )


EQUIVALENCE_MARGIN = 1 / 30
"""Margin of equivalence as a share of the most that a trial can earn: 10 of 300."""


def comparisons_of(
    samples: Mapping[str, np.ndarray],
    alike: Callable[[str, str], bool],
    margin: float,
) -> list[Comparison]:
    """A comparison per pair of experiments that are compared within one measure.

    Args:
        samples: of each experiment, `(runs,)`, none of them empty.
        alike: whether two experiments can be compared.
        margin: differences smaller than this count as none.
    """

    def p_equivalence(a: np.ndarray, b: np.ndarray) -> float:
        return equivalence(a, b, margin).p

    differing = contests(samples, alike, lambda a, b: mann_whitney(a, b).p)
    equal = contests(samples, alike, p_equivalence)
    return [
        Comparison(
            **vars(each),
            a12=_effect(each.of_a, each.of_b),
            shift=median_difference(each.of_a, each.of_b, generator()),
            equivalence=equivalence(each.of_a, each.of_b, margin),
            p_equivalence=like.p_holm,
        )
        for each, like in zip(differing, equal, strict=True)
    ]


def _effect(a: np.ndarray, b: np.ndarray) -> Interval:
    """A12, without an interval of few runs."""
    effect = a12_interval(a, b)
    if min(a.size, b.size) < FEWEST_FOR_INTERVAL:
        return Interval(effect.value, math.nan, math.nan)
    return effect


def comparisons(data: StudyData) -> dict[str, list[Comparison]]:
    """Every comparison of a study, by measure."""
    return {
        measure: comparisons_of(samples, data.alike, EQUIVALENCE_MARGIN * data.steps)
        for measure, samples in measures(data).items()
    }


PAIR_COLUMNS: Mapping[str, Callable[[Comparison], Any]] = {
    "a": lambda pair: pair.a,
    "b": lambda pair: pair.b,
    "n_a": lambda pair: pair.of_a.size,
    "n_b": lambda pair: pair.of_b.size,
    "median_a": lambda pair: float(np.median(pair.of_a)),
    "median_b": lambda pair: float(np.median(pair.of_b)),
    "u": lambda pair: mann_whitney(pair.of_a, pair.of_b).u,
    "p": lambda pair: pair.p,
    "method": lambda pair: mann_whitney(pair.of_a, pair.of_b).method,
    "p_holm": lambda pair: pair.p_holm,
    "family": lambda pair: pair.family,
    "a12": lambda pair: pair.a12.value,
    "a12_low": lambda pair: pair.a12.low,
    "a12_high": lambda pair: pair.a12.high,
    "median_difference": lambda pair: pair.shift.value,
    "median_difference_low": lambda pair: pair.shift.low,
    "median_difference_high": lambda pair: pair.shift.high,
    "shift": lambda pair: pair.equivalence.shift,
    "shift_low": lambda pair: pair.equivalence.low,
    "shift_high": lambda pair: pair.equivalence.high,
    "margin": lambda pair: pair.equivalence.margin,
    "p_equivalence": lambda pair: pair.equivalence.p,
    "p_equivalence_holm": lambda pair: pair.p_equivalence,
    "stars": lambda pair: stars(pair.p_holm, min(pair.of_a.size, pair.of_b.size)),
}
"""Columns of pairwise.csv after the measure."""


def pair_rows(data: StudyData) -> list[dict[str, Any]]:
    """A row per measure and comparison, as `PAIR_COLUMNS` says."""
    return [
        {"measure": measure}
        | {column: value(pair) for column, value in PAIR_COLUMNS.items()}
        for measure, pairs in comparisons(data).items()
        for pair in pairs
    ]


def comparisons_section(data: StudyData) -> list[Block]:
    """Pairs of experiments, in words for the first robot and in tables for all."""
    found = comparisons(data)
    first = shown_robots(data)[0]
    own = found[held_out_measure(first)]
    blocks: list[Block] = [Heading("Comparisons")]
    if not own:
        return [*blocks, Paragraph("Only one experiment has runs: nothing to compare.")]
    blocks.append(
        Paragraph(
            "Two-sided Mann-Whitney tests over runs. The first "
            f"{COMPARED_PAIRWISE} experiments are compared pair by pair. Each of the "
            "others is compared with the first. In each table these are two families "
            "of comparisons. The p values of each family are adjusted by Holm's "
            "method, for difference and for equivalence. Two experiments are "
            "equivalent if two one-sided Mann-Whitney tests exclude a shift of "
            f"{own[0].equivalence.margin:g} or more. A12 is the probability that "
            "a run of the first exceeds one of the second (0.5: no effect), with a "
            "95 % interval. The difference of medians has a bootstrap 95 % interval. "
            f"With fewer than {FEWEST_FOR_INTERVAL} runs there are no intervals, "
            "because they would contain the true value in fewer than 95 % of cases. "
            f"With fewer than {FEWEST_FOR_STARS} runs there are no stars and no "
            "verdict."
        )
    )
    blocks += [
        Paragraph(f"In held-out fitness on the {robot_name(first)}:"),
        Listing(
            [compared(pair, label(data, pair.a), label(data, pair.b)) for pair in own]
        ),
    ]
    for measure, pairs in found.items():
        blocks += [Heading(measure_title(measure, data), 3), _pair_table(data, pairs)]
    return blocks


def _pair_table(data: StudyData, pairs: Sequence[Comparison]) -> Table:
    unit = f"[of {data.steps}]"
    return Table(
        (
            *("first, second", "runs", f"medians {unit}", f"difference {unit}"),
            *("A12", "p", "Holm p", "stars", "equivalent, Holm p"),
        ),
        [
            (
                f"{label(data, pair.a)}, {label(data, pair.b)}",
                f"{pair.of_a.size}, {pair.of_b.size}",
                f"{np.median(pair.of_a):.1f}, {np.median(pair.of_b):.1f}",
                _with_bounds(pair.shift, ".1f"),
                _with_bounds(pair.a12, ".2f"),
                probability(pair.p).removeprefix("= "),
                probability(pair.p_holm).removeprefix("= "),
                PAIR_COLUMNS["stars"](pair),
                probability(pair.p_equivalence).removeprefix("= "),
            )
            for pair in pairs
        ],
    )


def _with_bounds(found: Interval, form: str) -> str:
    """A value, and its bounds if there are any."""
    value = f"{found.value:z{form}}"
    return value if math.isnan(found.low) else f"{value} {between(found, form)}"


def numbers(pair: Comparison) -> str:
    """A pair of experiments in numbers."""
    return (
        f"medians {np.median(pair.of_a):.1f} and {np.median(pair.of_b):.1f}, "
        f"difference {pair.shift.value:z.1f} {between(pair.shift, '.1f')}; "
        f"A12 {pair.a12.value:.2f} {between(pair.a12)}; "
        f"p {probability(pair.p)}, Holm {probability(pair.p_holm)}; equivalent "
        f"within {pair.equivalence.margin:.3g}: Holm p "
        f"{probability(pair.p_equivalence)}"
    )


def compared(pair: Comparison, a: str, b: str) -> str:
    """What a pair of experiments shows, and no more; the better one comes first.

    Args:
        pair: the experiments.
        a: name of the first for readers.
        b: name of the second.
    """
    if pair.a12.value < 0.5:
        pair, a, b = pair.turned(), b, a
    found = f"{numbers(pair)}; n = {pair.of_a.size} and {pair.of_b.size}"
    if not pair.enough:
        return (
            f"{a} and {b}: {found}. Fewer than {FEWEST_FOR_STARS} runs: "
            "no verdict on which is better."
        )
    margin = f"{pair.equivalence.margin:g}"
    if pair.decided and pair.equivalent:
        return f"{a} beats {b}, but by less than {margin}: {found}."
    if pair.equivalent:
        return (
            f"{a} and {b} are equivalent, they differ by less than {margin}: {found}."
        )
    if not pair.decided:
        return (
            f"{a} and {b}: no difference is shown, which does not show that there is "
            f"none: {found}."
        )
    return f"{a} beats {b} in {pair.a12.value:.0%} of the pairs of runs: {found}."
