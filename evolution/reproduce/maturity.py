"""Claims that DE has mature individuals earlier than a GA.

Maturity is measured by a run's own end, which favours runs that stop improving, and by
a target and a budget that are the same for all.
"""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from evolution.pages.words import LABELS, between, probability
from evolution.report.samples import BUDGETS, best_after
from evolution.reproduce.claim import Claim, claim_of, samples_of
from evolution.reproduce.verdicts import (
    CONSISTENT,
    INCONSISTENT,
    NOT_MEASURED,
    TOO_FEW,
    UNDECIDED,
    of_most,
)
from evolution.statistics.effect_sizes import a12_interval
from evolution.statistics.significance import (
    FEWEST_FOR_STARS,
    LEVELS,
    holm,
    mann_whitney,
)
from evolution.statistics.targets import evaluations_to_target
from evolution.study.data import StudyData

MATURE = 0.9
"""Share of its final best at which a run has mature individuals: our reading."""

EARLY = 0.5
"""Share of the budget that is early: the lenient reading."""

MATURE_TARGET = 0.75
"""Stored fitness, as a share of the most, by which an individual is mature: 225."""

MATURE_BUDGET = BUDGETS[0]
"""Evaluations that are early: the strict reading by a fixed budget."""

NEVER = 1e9
"""Stands for the evaluations of a run that never reached a target."""

PAIRS = (("de-best", "ga"), ("de-rand", "ga"))
"""Pairs of which the paper claims that the first is mature before the second."""


def maturity(study: StudyData, name: str) -> np.ndarray:
    """Share of its evaluations after which a run has 90 % of its best, `(runs,)`."""
    shares = []
    for run in study.runs[name]:
        best = np.maximum.accumulate(run.history["best"])
        first = (best >= MATURE * best[-1]).argmax()
        spent = run.history["evaluations"]
        shares.append(spent[first] / spent[-1])
    return np.array(shares)


def mature_by_own_end(early: dict[str, np.ndarray], name: str) -> Claim:
    """Claim by a run's own end as the yardstick: the lenient reading."""
    text = (
        f"{LABELS[name]} has mature individuals early (lenient: {MATURE:.0%} of its "
        f"own final best within {EARLY:.0%} of the budget)"
    )
    sample = early[name]
    return claim_of(text, sample, lambda: of_most(sample <= 100 * EARLY), "share spent")


def mature_by_fixed_measures(study: StudyData) -> list[Claim]:
    """Claims by a fixed target and a fixed budget: the strict readings.

    A run's own end favours runs that stop improving. It does not compare with the GA,
    as the paper does.
    """
    target, budget = MATURE_TARGET * study.steps, MATURE_BUDGET
    spent = samples_of(study, lambda name: spent_until(study, name, target))
    # sooner is better
    sooner = {name: -sample for name, sample in spent.items()}
    best = samples_of(study, lambda name: best_after(study.runs[name], budget))
    # both questions are one family: the lowest of its p values counts most
    found = []
    for samples, where, ours in (
        (sooner, f"in evaluations until {target:g} is stored (fewer is better)", spent),
        (best, f"in best (stored) fitness after {budget:,} evaluations", best),
    ):
        filled = {name: sample for name, sample in samples.items() if sample.size}
        if not all(study.alike(a, b) for a, b in combinations(filled, 2)):
            filled = {}
        found += [(pair, where, samples, ours) for pair in combinations(filled, 2)]
    if not found:
        return [
            Claim(f"{LABELS[a]} is mature before {LABELS[b]}", "-", "0", NOT_MEASURED)
            for a, b in PAIRS
        ]
    p = holm(
        np.array([mann_whitney(each[a], each[b]).p for (a, b), _, each, _ in found])
    )
    return [
        _sooner_claim(pair, where, samples, ours, adjusted)
        for (pair, where, samples, ours), adjusted in zip(
            found, p.tolist(), strict=True
        )
        # the paper does not compare the two DE variants
        if pair in PAIRS
    ]


def _sooner_claim(
    pair: tuple[str, str],
    where: str,
    samples: Mapping[str, np.ndarray],
    ours: Mapping[str, np.ndarray],
    p: float,
) -> Claim:
    """Claim that the first of a pair is ahead in one of the strict readings."""
    a, b = pair
    text = f"{LABELS[a]} is mature before {LABELS[b]} {where}"
    sizes = samples[a].size, samples[b].size
    effect = a12_interval(samples[a], samples[b])
    found = (
        f"medians {_count(ours[a])} and {_count(ours[b])}; A12 {effect.value:.2f} "
        f"{between(effect)}; Holm p {probability(p)}"
    )
    if min(sizes) < FEWEST_FOR_STARS:
        verdict = TOO_FEW
    elif p >= LEVELS[0]:
        verdict = UNDECIDED
    else:
        verdict = CONSISTENT if effect.value > 0.5 else INCONSISTENT
    return Claim(text, found, f"{sizes[0]} and {sizes[1]}", verdict)


def _count(sample: np.ndarray) -> str:
    """The median of numbers of evaluations, or of fitness."""
    median = float(np.median(sample))
    return "never" if median >= NEVER else f"{median:,.4g}"


def spent_until(study: StudyData, name: str, target: float) -> np.ndarray:
    """Evaluations until a stored fitness, `(runs,)`; `NEVER` if it was not reached."""
    spent = [
        evaluations_to_target(run.history["evaluations"], run.history["best"], target)
        for run in study.runs[name]
    ]
    return np.nan_to_num(np.array(spent), nan=NEVER)
