"""From rung to rung: what champions keep of their fitness on another robot."""

from evolution.pages.blocks import Block, Heading, Paragraph, Table
from evolution.pages.words import NOTHING, label, robot_name, spread
from evolution.report.samples import kept
from evolution.statistics.estimates import FEWEST_FOR_RANKS, rank_correlation
from evolution.study.data import StudyData


def from_rung_to_rung_section(data: StudyData) -> list[Block]:
    """Blocks about fitness kept from robot to robot; none if there is one robot."""
    if data.rungs is None:
        return []
    first, last = data.rungs
    rows = []
    for name, runs in data.with_runs.items():
        a, b = data.held_out(name, first), data.held_out(name, last)
        rank = rank_correlation(a, b)
        rows.append(
            (
                label(data, name),
                str(len(runs)),
                spread(a),
                spread(b),
                spread(kept(b, a), 100, ".0f"),
                NOTHING if rank is None else f"{rank:.2f}",
            )
        )
    one, other = robot_name(first), robot_name(last)
    return [
        Heading("From rung to rung"),
        Paragraph(
            f"Champions tested on the {one} and on the {other} from the same starts. "
            f"Kept: fitness on the {other} in percent of the fitness on the {one}, "
            "for each run. Rank correlation: Spearman's over runs, if there are at "
            f"least {FEWEST_FOR_RANKS} runs."
        ),
        Table(
            (
                "experiment",
                "runs",
                f"{one}: held-out [of {data.steps}]",
                f"{other}: held-out [of {data.steps}]",
                "kept [%]",
                "rank correlation",
            ),
            rows,
        ),
    ]
