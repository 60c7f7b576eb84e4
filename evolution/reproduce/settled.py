"""What is settled by the runs, what is not, and what would settle it: plain lists."""

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.pages.blocks import Block, Heading, Listing, Paragraph
from evolution.pages.words import between, label, probability
from evolution.report.sections.comparisons import Comparison
from evolution.reproduce.claim import Claim
from evolution.reproduce.verdicts import (
    CONSISTENT,
    INCONSISTENT,
    NOT_CONTRADICTED,
)
from evolution.statistics.equivalence import SHIFT_CONFIDENCE
from evolution.statistics.estimates import Interval
from evolution.statistics.significance import LEVELS
from evolution.study.data import StudyData

POWER = 0.8
"""Probability with which more runs should show something."""

MANY = 10_000
"""Numbers of runs above this are not named: they are too many to be done."""


def settled_blocks(
    study: StudyData, pairs: Sequence[Comparison], found: Sequence[Claim]
) -> list[Block]:
    """Lists of what is settled and of what is not.

    Args:
        study: whose runs they are.
        pairs: the paper's algorithms in held-out fitness on wheels.
        found: the paper's claims with verdicts.
    """
    settled = [line for pair in pairs if (line := _settled(study, pair))]
    open_ = [line for pair in pairs if (line := _open(study, pair))]
    holds = [each.text for each in found if each.verdict == CONSISTENT]
    fails = [each.text for each in found if each.verdict == INCONSISTENT]
    known = (CONSISTENT, INCONSISTENT, NOT_CONTRADICTED)
    unknown = [each for each in found if each.verdict not in known]
    no_verdict = "can't be tested: "
    unknown_lines = [
        f"{each.text}: {each.verdict.removeprefix(no_verdict)}" for each in unknown
    ]
    may = [each.text for each in found if each.verdict == NOT_CONTRADICTED]
    blocks: list[Block] = [Heading("What is settled")]
    blocks += _list(f"On new starts, on {WHEELED_ROBOT}:", settled)
    blocks += _list("Claims of the paper that hold here:", holds)
    blocks += _list("Claims of the paper that do not hold here:", fails)
    blocks += _list(
        "Claims that nothing contradicts here, which is a weaker result:", may
    )
    blocks += [Heading("What is not settled, and what would settle it")]
    blocks += _list(f"On new starts, on {WHEELED_ROBOT}:", open_)
    blocks += _list(
        "Claims without a verdict; the tables below say what was found:", unknown_lines
    )
    blocks.append(
        Paragraph(
            "Our runs cannot settle what the paper does not say: the length of a "
            "trial, the size of the tournament, what happens to weights that leave "
            "their bounds. The study of variations changes the last two, one at a "
            "time; two more studies change the length of a trial. Runs of the original "
            "program, or its source, would settle them."
        )
    )
    return blocks


def _list(title: str, lines: Sequence[str]) -> list[Block]:
    """A titled list; nothing if it is empty."""
    return [Paragraph(title), Listing(lines)] if lines else []


def _settled(study: StudyData, pair: Comparison) -> str | None:
    """What is settled about a pair of algorithms; None if nothing is."""
    if pair.a12.value < 0.5:
        pair = pair.turned()
    a, b = label(study, pair.a), label(study, pair.b)
    medians = f"medians {np.median(pair.of_a):.0f} and {np.median(pair.of_b):.0f}"
    n = f"n = {pair.of_a.size} and {pair.of_b.size}"
    margin = f"{pair.equivalence.margin:g} of {study.steps}"
    shift = _shift(pair)
    if pair.decided:
        less = f", but by less than {margin}" if pair.equivalent else ""
        p = probability(pair.p_holm)
        return f"{a} earns more than {b}{less}: {medians}, Holm p {p}, {n}."
    if pair.equivalent:
        return (
            f"{a} and {b} earn the same: they differ by less than {margin} ({shift}; "
            f"{medians}, {n})."
        )
    return None


def _open(study: StudyData, pair: Comparison) -> str | None:
    """What is open about a pair of algorithms, and how many runs would settle it."""
    if pair.enough and (pair.decided or pair.equivalent):
        return None
    a, b = label(study, pair.a), label(study, pair.b)
    differ, same = probability(pair.p_holm), probability(pair.p_equivalence)
    text = (
        f"Whether {a} or {b} earns more, or both the same: {_shift(pair)}. Holm p "
        f"{differ} of a difference, {same} of equivalence."
    )
    needed = runs_needed(pair)
    if needed is not None and needed <= MANY:
        text += (
            f" About {needed:,} runs of each would show one or the other with a "
            f"probability of {POWER:.0%}."
        )
    return text


def runs_needed(pair: Comparison) -> int | None:
    """Runs of each that show a difference or equivalence with a probability of 80 %.

    This assumes that the shift stays the same and that the interval narrows with the
    root of the number of runs. None if nothing is known of the spread.
    """
    found, n = pair.equivalence, min(pair.of_a.size, pair.of_b.size)
    half = (found.high - found.low) / 2
    away = max(abs(found.shift), found.margin - abs(found.shift))
    if half <= 0:
        return None
    normal = NormalDist()
    level = normal.inv_cdf(1 - LEVELS[0] / pair.family) + normal.inv_cdf(POWER)
    standard_error = half / normal.inv_cdf(0.5 + SHIFT_CONFIDENCE / 2)
    needed = max(n + 1, math.ceil(n * (level * standard_error / away) ** 2))
    # rounded up to two digits
    step = 10 ** max(0, len(str(needed)) - 2)
    return math.ceil(needed / step) * step


def _shift(pair: Comparison) -> str:
    found = pair.equivalence
    bounds = between(Interval(found.shift, found.low, found.high), ".1f")
    return f"Hodges-Lehmann difference {found.shift:z.1f}, 90 % interval {bounds}"
