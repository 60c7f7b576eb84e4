"""What a variation changes: fitness against the unchanged algorithm, and the order."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.pages.words import (
    PAPER_BEST,
    PAPERS,
    REPLICATES,
)
from evolution.report.samples import crash_rates, tests_of
from evolution.report.sections.comparisons import EQUIVALENCE_MARGIN
from evolution.statistics.best_of_few import chance_of_best, chance_of_order
from evolution.statistics.equivalence import Equivalence, equivalence
from evolution.statistics.significance import (
    FEWEST_FOR_STARS,
    LEVELS,
    holm,
    mann_whitney,
)
from evolution.study.data import StudyData

DECIMALS = 3
"""Decimals of fitness in the paper."""

UNCHANGED = "unchanged"
"""Name of what is not varied."""


@dataclass(frozen=True, eq=False)
class Varied:
    """Runs of one of the paper's algorithms, varied or not.

    Attributes:
        algorithm: the experiment of the paper that it is like.
        change: what is changed, as the experiment's name says it; or `UNCHANGED`.
        steps: control steps of a trial, the most that a fitness can be.
        step_fitness: name of the step fitness; another one measures something else.
        held_out: fitness of the champions on wheels, `(runs,)`.
        crash_rate: of the same trials, `(runs,)`.
        stored: best stored fitness of each run, `(runs,)`.
        against: how it is shifted against the unchanged algorithm, its p Holm-adjusted
            for all variations; None if there is none with comparable fitness.
        p: of a difference from it, likewise adjusted; nan if unknown.
    """

    algorithm: str
    change: str
    steps: int
    step_fitness: str
    held_out: np.ndarray
    crash_rate: np.ndarray
    stored: np.ndarray
    against: Equivalence | None = None
    p: float = math.nan

    @property
    def enough(self) -> bool:
        """Whether there are runs enough for a verdict."""
        return self.held_out.size >= FEWEST_FOR_STARS

    @property
    def differs(self) -> bool:
        """Whether the runs say that it differs from the unchanged algorithm."""
        return self.enough and self.p < LEVELS[0]

    @property
    def chance_of_papers(self) -> float:
        """Probability that the paper's best ranks as extreme among these runs."""
        return chance_of_best(self.stored, PAPER_BEST[self.algorithm], REPLICATES)

    @property
    def may_be_papers(self) -> bool:
        """Whether the paper's best is within these runs, and not too low for a best."""
        within = (self.stored > PAPER_BEST[self.algorithm]).any()
        return self.enough and bool(within) and self.chance_of_papers >= LEVELS[0]


@dataclass(frozen=True)
class Order:
    """Whether a change brings back the paper's order of best stored fitness.

    Attributes:
        change: what is changed, in the algorithms that it concerns.
        varied: these algorithms.
        chance: probability that the best of three runs each have the paper's order.
        medians: medians of best stored fitness, in the paper's order of algorithms.
        fewest: runs of the algorithm with the fewest.
    """

    change: str
    varied: tuple[str, ...]
    chance: float
    medians: tuple[float, ...]
    fewest: int

    @property
    def possible(self) -> bool:
        """Whether three runs each may well have the order: the lenient reading."""
        return self.chance >= LEVELS[0]

    @property
    def typical(self) -> bool:
        """Whether the medians have the order: the strict reading."""
        return all(a > b for a, b in zip(self.medians, self.medians[1:], strict=False))


def varied_of(studies: Sequence[StudyData]) -> list[Varied]:
    """All variations in studies, each compared with its unchanged algorithm.

    Experiments that are not named after one of the paper's are left out.
    """
    found = [
        Varied(
            algorithm,
            name.removeprefix(algorithm).removeprefix("-") or UNCHANGED,
            data.steps,
            data.configs[name].fitness,
            data.held_out(name, WHEELED_ROBOT),
            crash_rates(tests_of(data, name, WHEELED_ROBOT)),
            data.best_stored(name),
        )
        for data in studies
        for name in data.with_runs
        for algorithm in [_algorithm(name)]
        if algorithm is not None
    ]
    bases = {
        (each.algorithm, each.steps): each for each in found if each.change == UNCHANGED
    }
    compared = [
        (i, base)
        for i, each in enumerate(found)
        if each.change != UNCHANGED
        and (base := bases.get((each.algorithm, each.steps))) is not None
        and each.step_fitness == base.step_fitness
    ]
    if not compared:
        return found
    shifts = [
        equivalence(found[i].held_out, base.held_out, EQUIVALENCE_MARGIN * base.steps)
        for i, base in compared
    ]
    p = [mann_whitney(found[i].held_out, base.held_out).p for i, base in compared]
    alike = holm(np.array([shift.p for shift in shifts])).tolist()
    differ = holm(np.array(p)).tolist()
    for (i, _), shift, p_alike, p_differ in zip(
        compared, shifts, alike, differ, strict=True
    ):
        found[i] = replace(found[i], against=replace(shift, p=p_alike), p=p_differ)
    return found


def orders(varied: Sequence[Varied]) -> list[Order]:
    """For each change, the order of algorithms with it; unchanged where it has none."""
    by_change: dict[tuple[int, str], dict[str, Varied]] = {}
    for each in varied:
        by_change.setdefault((each.steps, each.change), {})[each.algorithm] = each
    found = []
    for (steps, change), changed in by_change.items():
        unchanged = by_change.get((steps, UNCHANGED), {})
        order = _order(change, changed, unchanged | changed)
        if order is not None:
            found.append(order)
    return found


def _order(
    change: str, changed: Mapping[str, Varied], everyone: Mapping[str, Varied]
) -> Order | None:
    """The order of algorithms with a change; None if one of them has no runs."""
    if not all(name in everyone for name in PAPERS):
        return None
    # with the paper's precision: further decimals decide no order
    samples = [np.round(everyone[name].stored, DECIMALS) for name in PAPERS]
    return Order(
        change,
        tuple(name for name in PAPERS if name in changed),
        chance_of_order(samples, REPLICATES),
        tuple(float(np.median(sample)) for sample in samples),
        min(sample.size for sample in samples),
    )


def _algorithm(name: str) -> str | None:
    """The paper's experiment that an experiment is named after."""
    for algorithm in PAPERS:
        if name == algorithm or name.startswith(f"{algorithm}-"):
            return algorithm
    return None
