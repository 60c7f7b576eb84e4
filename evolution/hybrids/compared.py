"""Comparisons of hybrids with DE/best, and of rules with the perturbation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.report import samples
from evolution.report.sections.comparisons import EQUIVALENCE_MARGIN
from evolution.search.lifetime_learning import LifetimeLearningParameters
from evolution.statistics.equivalence import Equivalence, equivalence
from evolution.statistics.significance import (
    FEWEST_FOR_STARS,
    holm,
    mann_whitney,
)
from evolution.statistics.targets import evaluations_to_target, mean_best_so_far
from evolution.study.data import StudyData

BASE = "de-best"
"""Experiment that all others are compared with."""

CONTROL = "perturbation"
"""Rule that is the control of all others."""

SHARE = LifetimeLearningParameters.learning_share
"""Share of the budget for lessons where it is not varied."""

USEFUL = 200.0
"""Stored fitness of a useful robot."""


@dataclass(frozen=True, eq=False)
class Compared:
    """Two experiments by held-out fitness on wheels.

    Attributes:
        name: experiment.
        other: the one that it is compared with.
        runs: number of runs of the one that has fewer.
        shift: of the first against the second, and the test that there is none, its p
            Holm-adjusted in the family.
        p: of a difference, likewise adjusted.
    """

    name: str
    other: str
    runs: int
    shift: Equivalence
    p: float

    @property
    def verdict(self) -> str:
        """Better, worse, equivalent, undecided; or that there are too few runs."""
        if self.runs < FEWEST_FOR_STARS:
            return "too few runs"
        return self.shift.verdict(self.p)


def against_base(data: StudyData) -> list[Compared]:
    """Every experiment against DE/best, except variations of the share; one family."""
    names = [
        name for name in data.with_runs if name != BASE and not _is_share(data, name)
    ]
    return _family(data, [(name, BASE) for name in names])


def against_control(data: StudyData) -> list[Compared]:
    """Each rule against the perturbation with its inheritance; one family."""
    runs = data.with_runs
    learning = {name: rule_of(data, name) for name in runs if not _is_share(data, name)}
    controls = {
        rule.inheritance: name
        for name, rule in learning.items()
        if rule is not None and rule.rule == CONTROL
    }
    pairs = [
        (name, controls[rule.inheritance])
        for name, rule in learning.items()
        if rule is not None and rule.rule != CONTROL and rule.inheritance in controls
    ]
    return _family(data, pairs)


def rule_of(data: StudyData, name: str) -> LifetimeLearningParameters | None:
    """How the individuals of an experiment learn in life; None if they do not."""
    optimizer = data.configs[name].optimizer
    return optimizer if isinstance(optimizer, LifetimeLearningParameters) else None


def sweep(data: StudyData) -> dict[str, dict[float, np.ndarray]]:
    """Held-out fitness on wheels by rule and by the share of the budget for lessons.

    Only experiments with Lamarckian inheritance; share 0 is DE/best.
    """
    found: dict[str, dict[float, np.ndarray]] = {}
    for name in data.with_runs:
        rule = rule_of(data, name)
        if rule is not None and rule.inheritance == "lamarckian":
            fitness = data.held_out(name, WHEELED_ROBOT)
            found.setdefault(rule.rule, {})[rule.learning_share] = fitness
    if BASE in data.with_runs:
        for by_share in found.values():
            by_share[0.0] = data.held_out(BASE, WHEELED_ROBOT)
    return {rule: dict(sorted(each.items())) for rule, each in found.items()}


def trials_to_useful(data: StudyData, name: str) -> np.ndarray:
    """Trials until stored fitness was `USEFUL`, `(runs,)`; nan if it never was."""
    trials = data.configs[name].trials
    return np.array(
        [
            trials
            * evaluations_to_target(
                run.history["evaluations"], run.history["best"], USEFUL
            )
            for run in data.runs[name]
        ]
    )


def means_so_far(data: StudyData, name: str) -> np.ndarray:
    """Stored best so far, the mean over the budget, `(runs,)`."""
    histories = (run.history for run in data.runs[name])
    return np.array([mean_best_so_far(h["evaluations"], h["best"]) for h in histories])


def crash_rates(data: StudyData, name: str) -> np.ndarray:
    """Shares of the champions' test trials on wheels that crash, `(runs,)`."""
    return samples.crash_rates(samples.tests_of(data, name, WHEELED_ROBOT))


def median_with_never(values: np.ndarray) -> float:
    """Median of `(n,)` where nan is later than all others; inf if half of them are."""
    return float(np.median(np.where(np.isnan(values), math.inf, values)))


def _is_share(data: StudyData, name: str) -> bool:
    """Whether an experiment is there to vary the share of the budget."""
    rule = rule_of(data, name)
    return rule is not None and rule.learning_share != SHARE


def _family(data: StudyData, pairs: Sequence[tuple[str, str]]) -> list[Compared]:
    if not pairs:
        return []
    samples = [
        (data.held_out(a, WHEELED_ROBOT), data.held_out(b, WHEELED_ROBOT))
        for a, b in pairs
    ]
    margin = EQUIVALENCE_MARGIN * data.steps
    shifts = [equivalence(a, b, margin) for a, b in samples]
    alike = holm(np.array([shift.p for shift in shifts])).tolist()
    differ = holm(np.array([mann_whitney(a, b).p for a, b in samples])).tolist()
    return [
        Compared(*names, min(map(len, two)), replace(shift, p=p_alike), p)
        for names, two, shift, p_alike, p in zip(
            pairs, samples, shifts, alike, differ, strict=True
        )
    ]
