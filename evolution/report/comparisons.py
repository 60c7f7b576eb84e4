"""Experiments held against each other, pair by pair, and against two criteria.

P values are Holm-adjusted. The family is all pairs of experiments within one measure,
or within one criterion and robot: each such table is a question of its own.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from evolution.comparisons import (
    MannWhitney,
    a12_interval,
    fisher,
    holm,
    mann_whitney,
    median_difference,
    stars,
)
from evolution.report.claims import FOLLOWING, following_share
from evolution.report.figures.style import with_runs, yardstick
from evolution.report.tables import generator, measures, shown_robots
from evolution.statistics import Interval, wilson
from evolution.study_data import RunData, StudyData

BEATS, FOLLOWS = "beats the hand-written follower", "follows walls"
"""Criteria of success.

The first asks for the yardstick's mean on the same starts: what the sensors allow
without evolution. The second asks that at least `FOLLOWING` of the test trials are a
wall follower's or a hugger's: the behaviour that the paper claims, whatever its
fitness.
"""


@dataclass(frozen=True)
class PairRow:
    """Two experiments in one measure.

    Attributes:
        measure: "stored", or "held-out" and the robot.
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
        a12_low: 95 % bound, nan if either has one run.
        a12_high: likewise.
        median_difference: first minus second.
        median_difference_low: bootstrap 95 % bound, nan if either has one run.
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


@dataclass(frozen=True)
class SuccessRow:
    """Runs of an experiment that meet a criterion, alone or against another's.

    Attributes:
        criterion: `BEATS` or `FOLLOWS`.
        robot: on which.
        experiment: its name.
        successes: runs that meet it.
        n: runs.
        share: of the runs.
        low: Wilson's 95 % bound.
        high: likewise.
        other: name of the other experiment, None in an experiment's own row, as all
            that follows.
        other_successes: its runs that meet it.
        other_n: its runs.
        fisher_p: of Fisher's exact test, two-sided.
        fisher_p_holm: adjusted for the family.
        family: tests in it.
    """

    criterion: str
    robot: str
    experiment: str
    successes: int
    n: int
    share: float
    low: float
    high: float
    other: str | None = None
    other_successes: int | None = None
    other_n: int | None = None
    fisher_p: float | None = None
    fisher_p_holm: float | None = None
    family: int | None = None


def pair_rows(data: StudyData) -> list[PairRow]:
    """A row per measure and pair of experiments with runs, in the study's order."""
    return [
        row
        for measure, samples in measures(data).items()
        for row in _pairs(measure, samples)
    ]


def _pairs(measure: str, samples: Mapping[str, np.ndarray]) -> list[PairRow]:
    pairs = list(combinations(samples, 2))
    tests = [_test(samples[a], samples[b]) for a, b in pairs]
    rows = []
    for (a, b), test, p in zip(pairs, tests, _holm([t.p for t in tests]), strict=True):
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


def _test(a: np.ndarray, b: np.ndarray) -> MannWhitney:
    # ranks of equal values have no variance to divide by
    if np.ptp(np.concatenate([a, b])) == 0:
        return MannWhitney(u=a.size * b.size / 2, p=1.0, exact=True)
    return mann_whitney(a, b)


def _effect(a: np.ndarray, b: np.ndarray) -> Interval:
    """A12; one run says nothing about the spread, so it has no interval."""
    effect = a12_interval(a, b)
    if min(a.size, b.size) < 2:
        return Interval(effect.value, math.nan, math.nan)
    return effect


def success_rows(data: StudyData) -> list[SuccessRow]:
    """For each criterion and robot, a row per experiment, then one per pair.

    Without a yardstick there is no `BEATS`, without behaviour classes no `FOLLOWS`.
    """
    rows = []
    for robot in shown_robots(data):
        for criterion, met in _criteria(data, robot).items():
            outcomes = {
                name: [met(run) for run in runs]
                for name, runs in with_runs(data).items()
            }
            rows += _successes(criterion, robot, outcomes)
    # all of a criterion together
    return sorted(rows, key=lambda row: (BEATS, FOLLOWS).index(row.criterion))


def _criteria(data: StudyData, robot: str) -> dict[str, Callable[[RunData], bool]]:
    """What the data can tell of each run on a robot."""
    reference, found = yardstick(data, robot), {}
    if reference is not None:
        found[BEATS] = lambda run: run.held_out(robot) >= reference
    everything = [run for runs in data.runs.values() for run in runs]
    if all(_test_of(run, robot).get("behaviour") for run in everything):
        found[FOLLOWS] = lambda run: following_share(_test_of(run, robot)) >= FOLLOWING
    return found


def _test_of(run: RunData, robot: str) -> Any:
    return run.champion.scores["held_out"][robot]


def _successes(
    criterion: str, robot: str, outcomes: Mapping[str, Sequence[bool]]
) -> list[SuccessRow]:
    alone = {}
    for name, met in outcomes.items():
        share = wilson(sum(met), len(met))
        alone[name] = SuccessRow(
            criterion=criterion,
            robot=robot,
            experiment=name,
            successes=sum(met),
            n=len(met),
            share=share.value,
            low=share.low,
            high=share.high,
        )
    pairs = list(combinations(alone.values(), 2))
    tests = [fisher(a.successes, a.n, b.successes, b.n) for a, b in pairs]
    return [
        *alone.values(),
        *(
            SuccessRow(
                criterion=criterion,
                robot=robot,
                experiment=a.experiment,
                successes=a.successes,
                n=a.n,
                share=a.share,
                low=a.low,
                high=a.high,
                other=b.experiment,
                other_successes=b.successes,
                other_n=b.n,
                fisher_p=p,
                fisher_p_holm=adjusted,
                family=len(pairs),
            )
            for (a, b), p, adjusted in zip(pairs, tests, _holm(tests), strict=True)
        ),
    ]


def _holm(p_values: Sequence[float]) -> list[float]:
    """Adjusted p values; none of none."""
    return holm(np.array(p_values)).tolist() if p_values else []
