"""Experiments held against two criteria: in how many runs they succeed.

P values are Holm-adjusted. The family is all pairs of experiments within one criterion
and robot.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from evolution.report.samples import FOLLOWING
from evolution.report.tables import shown_robots
from evolution.statistics.comparisons import FEWEST_FOR_STARS, LEVELS, fisher, holm
from evolution.statistics.samples import wilson
from evolution.study.data import RunData, StudyData

MATCHES, FOLLOWS = "matches the hand-written follower", "follows walls"
"""Criteria of success.

The first asks for the yardstick's mean on the same starts: of one follower, which
keeps 8 mm off the wall, where closer earns more. The second asks that at least
`FOLLOWING` of the test trials are a wall follower's or a hugger's: the behaviour that
the paper claims, whatever its fitness.
"""


@dataclass(frozen=True)
class SuccessRow:
    """Runs of an experiment that meet a criterion, alone or against another's.

    Attributes:
        criterion: `MATCHES` or `FOLLOWS`.
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

    @property
    def decided(self) -> bool:
        """Whether there are runs enough, and they say that the two differ."""
        if self.fisher_p_holm is None or self.other_n is None:
            return False
        enough = min(self.n, self.other_n) >= FEWEST_FOR_STARS
        return enough and self.fisher_p_holm < LEVELS[0]


def success_rows(data: StudyData) -> list[SuccessRow]:
    """For each criterion and robot, a row per experiment, then one per pair.

    Without a yardstick there is no `MATCHES`, without behaviour classes no `FOLLOWS`.
    """
    rows = []
    for robot in shown_robots(data):
        for criterion, met in _criteria(data, robot).items():
            outcomes = {
                name: [met(run) for run in runs]
                for name, runs in data.with_runs.items()
            }
            rows += _successes(criterion, robot, outcomes, data.alike)
    # all of a criterion together
    return sorted(rows, key=lambda row: (MATCHES, FOLLOWS).index(row.criterion))


def _criteria(data: StudyData, robot: str) -> dict[str, Callable[[RunData], bool]]:
    """What the data can tell of each run on a robot."""
    reference, found = data.yardstick_mean(robot), {}
    if reference is not None:
        found[MATCHES] = lambda run: run.held_out(robot) >= reference
    everything = [run for runs in data.runs.values() for run in runs]
    if all(run.scores.held_out[robot].behaviour for run in everything):
        found[FOLLOWS] = lambda run: run.scores.held_out[robot].following >= FOLLOWING
    return found


def _successes(
    criterion: str,
    robot: str,
    outcomes: Mapping[str, Sequence[bool]],
    alike: Callable[[str, str], bool],
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
    pairs = [(alone[a], alone[b]) for a, b in combinations(alone, 2) if alike(a, b)]
    if not pairs:
        return list(alone.values())
    tests = [fisher(a.successes, a.n, b.successes, b.n) for a, b in pairs]
    adjusted = holm(np.array(tests)).tolist()
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
                fisher_p_holm=p_holm,
                family=len(pairs),
            )
            for (a, b), p, p_holm in zip(pairs, tests, adjusted, strict=True)
        ),
    ]
