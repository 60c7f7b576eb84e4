"""The contests of a report: experiments against each other and against targets."""

from collections.abc import Sequence
from dataclasses import replace

from evolution.comparisons import FEWEST_FOR_STARS, LEVELS
from evolution.report.blocks import Block, Heading, Listing, Paragraph, Table
from evolution.report.claims import FOLLOWING
from evolution.report.comparisons import (
    BEATS,
    FOLLOWS,
    PairRow,
    SuccessRow,
    pair_rows,
    success_rows,
)
from evolution.report.figures.style import YARDSTICK_LABEL, robot_name, with_runs
from evolution.report.tables import (
    TargetRow,
    held_out_measure,
    labels_of,
    shown_robots,
    target_rows,
)
from evolution.report.words import between, evaluations, probability
from evolution.study_data import StudyData


def comparisons(data: StudyData) -> list[Block]:
    """Pairs of experiments, in words for the first robot and in tables for all."""
    labels, rows = labels_of(data), pair_rows(data)
    blocks: list[Block] = [Heading("Comparisons")]
    if not rows:
        return [*blocks, Paragraph("One experiment with runs: nothing to compare.")]
    blocks.append(
        Paragraph(
            "Two-sided Mann-Whitney tests over runs; Holm's adjustment within each "
            f"table ({rows[0].family} pairs). A12 is the probability that a run of the "
            "first exceeds one of the second (0.5: no effect), with a 95 % interval; "
            "the difference of medians has a bootstrap 95 % interval. Below 10 runs "
            "there are no stars and no verdict."
        )
    )
    first = shown_robots(data)[0]
    own = [row for row in rows if row.measure == held_out_measure(first)]
    blocks += [
        Paragraph(f"In held-out fitness on the {robot_name(first)}:"),
        Listing([compared(row, labels[row.a], labels[row.b]) for row in own]),
    ]
    for measure in dict.fromkeys(row.measure for row in rows):
        blocks += [
            Heading(_measure_title(measure, data), 3),
            _pair_table([row for row in rows if row.measure == measure], labels),
        ]
    return blocks


def _measure_title(measure: str, data: StudyData) -> str:
    titles = {
        held_out_measure(robot): f"Held-out fitness, {robot_name(robot)}"
        for robot in data.robots
    }
    return titles.get(measure, "Stored fitness, what evolution believes")


def _pair_table(rows: Sequence[PairRow], labels: dict[str, str]) -> Table:
    columns = ("first", "second", "n", "medians", "difference", "A12", "p", "Holm", "")
    return Table(
        columns,
        [
            (
                labels[row.a],
                labels[row.b],
                f"{row.n_a}, {row.n_b}",
                f"{row.median_a:.1f}, {row.median_b:.1f}",
                f"{row.median_difference:.1f} "
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
    labels, rows = labels_of(data), success_rows(data)
    blocks: list[Block] = [Heading("Success")]
    meanings = {
        BEATS: f"held-out mean of at least the {YARDSTICK_LABEL}'s on the same starts",
        FOLLOWS: f"at least {FOLLOWING:.0%} of the test trials are a wall follower's "
        "or a hugger's",
    }
    for criterion, meaning in meanings.items():
        found = [row for row in rows if row.criterion == criterion]
        if not found:
            absent = (
                "the hand-written wall follower was not tested"
                if criterion == BEATS
                else "not every run has behaviour classes"
            )
            blocks.append(Paragraph(f"A run {criterion}: not known, {absent}."))
            continue
        blocks += [
            Paragraph(f"A run {criterion}: {meaning}. Share with Wilson 95 % bounds."),
            _success_table(found, labels),
        ]
        pairs = [row for row in found if row.fisher_p_holm is not None]
        if pairs:
            lowest = min(row.fisher_p_holm or 0.0 for row in pairs)
            blocks.append(
                Paragraph(
                    f"Fisher's exact test, {pairs[0].family} pairs per robot, "
                    f"Holm-adjusted: the lowest p {probability(lowest)} (success.csv)."
                )
            )
    return blocks


def _success_table(rows: Sequence[SuccessRow], labels: dict[str, str]) -> Table:
    return Table(
        ("experiment", "robot", "runs", "share"),
        [
            (
                labels[row.experiment],
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
    labels, rows = labels_of(data), target_rows(data)
    goals = dict.fromkeys(row.target for row in rows)
    found = {(row.experiment, row.target): row for row in rows}
    return [
        Heading("Cost of targets"),
        Paragraph(
            "Expected running time in individual evaluations, if whoever fails starts "
            "again, and the runs that reached the target. Targets are of stored "
            "fitness, the only one that a history has, so luck counts here. Intervals "
            "are in targets.csv."
        ),
        Table(
            ("experiment", *(f"{goal:g}" for goal in goals)),
            [
                (labels[name], *(_cost(found[name, goal]) for goal in goals))
                for name in with_runs(data)
            ],
        ),
    ]


def _cost(row: TargetRow) -> str:
    return f"{evaluations(row.expected_running_time)} ({row.hits}/{row.n})"


def compared(row: PairRow, a: str, b: str) -> str:
    """What a pair of experiments shows, and no more; the better one comes first.

    Args:
        row: the pair.
        a: name of the first for readers.
        b: name of the second.
    """
    if row.a12 < 0.5:
        row, a, b = _turned(row), b, a
    numbers = (
        f"medians {row.median_a:.1f} and {row.median_b:.1f}, difference "
        f"{row.median_difference:.1f} "
        + between(row.median_difference_low, row.median_difference_high, ".1f")
        + f"; A12 {row.a12:.2f} {between(row.a12_low, row.a12_high)}; "
        f"p {probability(row.p)}, Holm {probability(row.p_holm)}; "
        f"n = {row.n_a} and {row.n_b}"
    )
    if min(row.n_a, row.n_b) < FEWEST_FOR_STARS:
        return (
            f"{a} and {b}: {numbers}. Fewer than {FEWEST_FOR_STARS} runs: "
            "no verdict on which is better."
        )
    if row.p_holm >= LEVELS[0]:
        return (
            f"{a} and {b}: no difference is shown, which does not show that there is "
            f"none: {numbers}."
        )
    return f"{a} beats {b} in {row.a12:.0%} of the pairs of runs: {numbers}."


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
