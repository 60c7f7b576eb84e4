"""The contests of a report: experiments against each other and against targets."""

from collections.abc import Sequence

from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table
from evolution.pages.words import (
    YARDSTICK_LABEL,
    between,
    evaluations,
    label,
    probability,
    robot_name,
)
from evolution.report.pairs import PairRow, compared, pair_rows
from evolution.report.samples import FOLLOWING
from evolution.report.successes import FOLLOWS, MATCHES, SuccessRow, success_rows
from evolution.report.tables import (
    TargetRow,
    held_out_measure,
    shown_robots,
    target_rows,
)
from evolution.statistics.comparisons import FEWEST_FOR_STARS, LEVELS
from evolution.statistics.samples import FEWEST_FOR_INTERVAL
from evolution.study.data import StudyData


def comparisons(data: StudyData) -> list[Block]:
    """Pairs of experiments, in words for the first robot and in tables for all."""
    rows = pair_rows(data)
    blocks: list[Block] = [Heading("Comparisons")]
    if not rows:
        return [*blocks, Paragraph("One experiment with runs: nothing to compare.")]
    blocks.append(
        Paragraph(
            "Two-sided Mann-Whitney tests over runs; Holm's adjustment within each "
            f"table ({rows[0].family} pairs). A12 is the probability that a run of the "
            "first exceeds one of the second (0.5: no effect), with a 95 % interval; "
            "the difference of medians has a bootstrap 95 % interval. Below "
            f"{FEWEST_FOR_INTERVAL} runs there are no intervals, which would not hold "
            f"their 95 %; below {FEWEST_FOR_STARS} no stars and no verdict."
        )
    )
    first = shown_robots(data)[0]
    own = [row for row in rows if row.measure == held_out_measure(first)]
    blocks += [
        Paragraph(f"In held-out fitness on the {robot_name(first)}:"),
        Listing([compared(row, label(row.a), label(row.b)) for row in own]),
    ]
    for measure in dict.fromkeys(row.measure for row in rows):
        blocks += [
            Heading(_measure_title(measure, data), 3),
            _pair_table([row for row in rows if row.measure == measure]),
        ]
    return blocks


def _measure_title(measure: str, data: StudyData) -> str:
    titles = {
        held_out_measure(robot): f"Held-out fitness, {robot_name(robot)}"
        for robot in data.robots
    }
    return titles.get(measure, "Best stored fitness, what the paper reports")


def _pair_table(rows: Sequence[PairRow]) -> Table:
    columns = ("first", "second", "n", "medians", "difference", "A12", "p", "Holm", "")
    return Table(
        columns,
        [
            (
                label(row.a),
                label(row.b),
                f"{row.n_a}, {row.n_b}",
                f"{row.median_a:.1f}, {row.median_b:.1f}",
                f"{row.median_difference:z.1f} "
                + between(row.median_difference_low, row.median_difference_high, ".1f"),
                f"{row.a12:.2f} {between(row.a12_low, row.a12_high)}",
                probability(row.p).removeprefix("= "),
                probability(row.p_holm).removeprefix("= "),
                row.stars,
            )
            for row in rows
        ],
        texts=2,
    )


def successes(data: StudyData) -> list[Block]:
    """Shares of runs that meet a criterion; nothing if the data have none."""
    rows = success_rows(data)
    blocks: list[Block] = [Heading("Success")]
    meanings = {
        MATCHES: f"held-out mean of at least the {YARDSTICK_LABEL}'s on the same "
        "starts; it keeps 8 mm off the wall, and closer earns more",
        FOLLOWS: f"at least {FOLLOWING:.0%} of the test trials are a wall follower's "
        "or a hugger's",
    }
    for criterion, meaning in meanings.items():
        found = [row for row in rows if row.criterion == criterion]
        if not found:
            absent = (
                "the hand-written wall follower was not tested in the setting of all"
                if criterion == MATCHES
                else "not every run has behaviour classes"
            )
            blocks.append(Paragraph(f"A run {criterion}: not known, {absent}."))
            continue
        blocks += [
            Paragraph(f"A run {criterion}: {meaning}. Share with Wilson 95 % bounds."),
            _success_table(found),
        ]
        pairs = [row for row in found if row.fisher_p_holm is not None]
        if pairs:
            blocks += [
                Paragraph(
                    f"Fisher's exact test of the {pairs[0].family} pairs of a robot, "
                    "Holm-adjusted within them; pairs that differ with p < "
                    f"{LEVELS[0]}, of {FEWEST_FOR_STARS} runs each at least (all: "
                    "success.csv):"
                ),
                Listing([_fisher(row) for row in pairs if row.decided] or ["none"]),
            ]
    return blocks


def _fisher(row: SuccessRow) -> str:
    return (
        f"{label(row.experiment)} and {label(row.other or '')}, "
        f"{robot_name(row.robot)}: {row.successes} of {row.n} and "
        f"{row.other_successes} of {row.other_n}, Holm "
        f"p {probability(row.fisher_p_holm or 0.0)}"
    )


def _success_table(rows: Sequence[SuccessRow]) -> Table:
    return Table(
        ("experiment", "robot", "runs", "share"),
        [
            (
                label(row.experiment),
                robot_name(row.robot),
                f"{row.successes} of {row.n}",
                f"{row.share:.0%} [{row.low:.0%}, {row.high:.0%}]",
            )
            for row in rows
            if row.other is None
        ],
        texts=2,
    )


def targets(data: StudyData) -> list[Block]:
    """What each target cost."""
    rows = target_rows(data)
    goals = dict.fromkeys(row.target for row in rows)
    found = {(row.experiment, row.target): row for row in rows}
    return [
        Heading("Cost of targets"),
        Paragraph(
            "Expected running time in individual evaluations, if whoever fails starts "
            "again, and the runs that reached the target (none: not within any run's "
            "budget). Targets are of stored "
            "fitness, the only one that a history has, so luck counts here. Intervals "
            "are in targets.csv."
        ),
        Table(
            ("experiment", *(f"{goal:g}" for goal in goals)),
            [
                (label(name), *(_cost(found[name, goal]) for goal in goals))
                for name in data.with_runs
            ],
        ),
    ]


def _cost(row: TargetRow) -> str:
    if not row.hits:
        return f"none ({row.hits}/{row.n})"
    return f"{evaluations(row.expected_running_time)} ({row.hits}/{row.n})"
