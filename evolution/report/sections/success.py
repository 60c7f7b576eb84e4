"""Success: in how many runs each experiment meets a criterion, with comparisons."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table
from evolution.pages.words import YARDSTICK_LABEL, label, probability, robot_name
from evolution.report.contests import COMPARED_PAIRWISE, Contest, contests
from evolution.report.measures import shown_robots
from evolution.report.samples import FOLLOWED
from evolution.statistics.estimates import Interval, wilson
from evolution.statistics.significance import FEWEST_FOR_STARS, LEVELS, fisher
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun

MATCHES = "matches the hand-written follower"
FOLLOWS, KEEPS_OFF = "follows walls", "follows walls without hugging"
"""Criteria of success.

The first asks for at least the mean of the hand-written follower on the same starts.
This follower keeps 8 mm from the wall, and driving closer earns more. The others ask
for the behaviour that the paper claims, with any fitness. In the lenient reading, at
least `FOLLOWED` of the test trials are in the class of wall followers or of huggers; in
the strict reading, in the class of wall followers.
"""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Runs that meet a criterion on a robot.

    Attributes:
        criterion: `MATCHES`, `FOLLOWS` or `KEEPS_OFF`.
        robot: on which.
        met: whether each run of an experiment meets it, `(runs,)`, by experiment.
        pairs: the experiments against each other, by Fisher's exact test.
    """

    criterion: str
    robot: str
    met: Mapping[str, np.ndarray]
    pairs: Sequence[Contest]

    def share(self, name: str) -> Interval:
        """Share of an experiment's runs, with Wilson's 95 % bounds."""
        return wilson(int(self.met[name].sum()), self.met[name].size)


def outcomes(data: StudyData) -> list[Outcomes]:
    """Outcomes of each criterion on each robot, as far as they are known.

    Without a yardstick there is no `MATCHES`, without behaviour classes no other.
    """
    found = []
    for robot in shown_robots(data):
        for criterion, meets in _criteria(data, robot).items():
            met = {
                name: np.array([meets(run) for run in runs])
                for name, runs in data.with_runs.items()
            }
            pairs = contests(met, data.alike, _fisher_p)
            found.append(Outcomes(criterion, robot, met, pairs))
    # sorted by criterion
    return sorted(
        found, key=lambda each: (MATCHES, FOLLOWS, KEEPS_OFF).index(each.criterion)
    )


def _fisher_p(a: np.ndarray, b: np.ndarray) -> float:
    return fisher(int(a.sum()), a.size, int(b.sum()), b.size)


def _criteria(data: StudyData, robot: str) -> dict[str, Callable[[FinishedRun], bool]]:
    """What the data can tell of each run on a robot."""
    reference, found = data.yardstick_mean(robot), {}
    if reference is not None:
        found[MATCHES] = lambda run: run.held_out(robot) >= reference
    everything = [run for runs in data.runs.values() for run in runs]
    if all(run.scores.held_out[robot].behaviour for run in everything):
        found[FOLLOWS] = lambda run: run.scores.held_out[robot].following >= FOLLOWED
        found[KEEPS_OFF] = lambda run: run.scores.held_out[robot].keeping >= FOLLOWED
    return found


SUCCESS_COLUMNS = (
    *("criterion", "robot", "experiment", "successes", "n", "share", "low", "high"),
    *("other", "other_successes", "other_n", "fisher_p", "fisher_p_holm", "family"),
)
"""Columns of success.csv; from `other` on they are of pairs only."""


def success_rows(data: StudyData) -> list[dict[str, Any]]:
    """For each criterion and robot, a row per experiment, then one per pair."""
    rows = []
    for each in outcomes(data):
        alone = {name: _row(each, name) for name in each.met}
        rows += alone.values()
        rows += [
            alone[pair.a]
            | {
                "other": pair.b,
                "other_successes": int(pair.of_b.sum()),
                "other_n": pair.of_b.size,
                "fisher_p": pair.p,
                "fisher_p_holm": pair.p_holm,
                "family": pair.family,
            }
            for pair in each.pairs
        ]
    return rows


def _row(found: Outcomes, name: str) -> dict[str, Any]:
    met, share = found.met[name], found.share(name)
    return dict.fromkeys(SUCCESS_COLUMNS) | {
        "criterion": found.criterion,
        "robot": found.robot,
        "experiment": name,
        "successes": int(met.sum()),
        "n": met.size,
        "share": share.value,
        "low": share.low,
        "high": share.high,
    }


def success_section(data: StudyData) -> list[Block]:
    """Shares of runs that meet a criterion; nothing if the data have none."""
    everything = outcomes(data)
    blocks: list[Block] = [Heading("Success")]
    meanings = {
        MATCHES: f"held-out mean of at least the {YARDSTICK_LABEL}'s on the same "
        "starts (it keeps 8 mm from the wall, and driving closer earns more)",
        FOLLOWS: f"at least {FOLLOWED:.0%} of the test trials are in the class of wall "
        "followers or of huggers, whose mean clearance is below 5 mm",
        KEEPS_OFF: f"at least {FOLLOWED:.0%} of the test trials are in the class of "
        "wall followers",
    }
    for criterion, meaning in meanings.items():
        found = [each for each in everything if each.criterion == criterion]
        if not found:
            absent = (
                "the hand-written wall follower was not tested in the runs' setting"
                if criterion == MATCHES
                else "not every run has behaviour classes"
            )
            blocks.append(Paragraph(f"A run {criterion}: not known, {absent}."))
            continue
        blocks += [
            Paragraph(f"A run {criterion}: {meaning}. Share with Wilson 95 % bounds."),
            _success_table(data, found),
        ]
        pairs = [(each.robot, pair) for each in found for pair in each.pairs]
        if pairs:
            decided = [
                _fisher(data, robot, pair) for robot, pair in pairs if pair.decided
            ]
            blocks += [
                Paragraph(
                    "Fisher's exact test on each robot, Holm-adjusted. The first "
                    f"{COMPARED_PAIRWISE} experiments are compared pair by pair, and "
                    "each of the others with the first. These pairs, with at least "
                    f"{FEWEST_FOR_STARS} runs each, differ with p < {LEVELS[0]} "
                    "(success.csv has all pairs):"
                ),
                Listing(decided or ["none"]),
            ]
    return blocks


def _fisher(data: StudyData, robot: str, pair: Contest) -> str:
    return (
        f"{label(data, pair.a)} and {label(data, pair.b)}, {robot_name(robot)}: "
        f"{pair.of_a.sum()} of {pair.of_a.size} and "
        f"{pair.of_b.sum()} of {pair.of_b.size}, Holm p {probability(pair.p_holm)}"
    )


def _success_table(data: StudyData, found: Sequence[Outcomes]) -> Table:
    """A row per experiment, columns per robot."""
    columns = ["experiment"]
    for each in found:
        who = robot_name(each.robot)
        columns += [f"{who}: runs", f"{who}: share [%]"]
    rows = []
    for name in data.with_runs:
        row = [label(data, name)]
        for each in found:
            met, share = each.met[name], each.share(name)
            low, high = 100 * share.low, 100 * share.high
            row += [
                f"{met.sum()} of {met.size}",
                f"{100 * share.value:.0f} [{low:.0f}, {high:.0f}]",
            ]
        rows.append(row)
    return Table(columns, rows)
