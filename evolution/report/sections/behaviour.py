"""Behaviour: what champions do, and how close to the wall they drive."""

import math
from collections.abc import Sequence

from epuck_mj.trials.behaviour_classes import HUG, MEANINGS
from epuck_mj.trials.metrics import FOLLOWING_SHARE
from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table
from evolution.pages.words import (
    NOTHING,
    YARDSTICK_LABEL,
    label,
    percent,
    percent_median,
    robot_name,
    spread,
)
from evolution.report.measures import shown_robots
from evolution.report.samples import class_means, clearances, whole_laps
from evolution.study.data import StudyData


def behaviour_section(data: StudyData) -> list[Block]:
    """What champions do, and how close to the wall they drive."""
    shares = [
        class_means(data, name, robot)
        for robot in shown_robots(data)
        for name in data.with_runs
    ]
    classes = dict.fromkeys(name for each in shares for name in each)
    seen = [c for c in classes if any(each.get(c) for each in shares)]
    if not seen:
        return [
            Heading("Behaviour"),
            Paragraph("Not known: no run has behaviour classes."),
        ]
    return [
        Heading("Behaviour"),
        Paragraph(
            "The tables show the share of the test trials in each class (mean over "
            "runs), the mean clearance from shell to wall in mm while a wall is near "
            "(median [quartiles] over runs), and how many champions have a mean "
            f"clearance below {HUG * 1000:.0f} mm. A champion that drives so close to "
            "the wall will probably fail on a real robot, whose sensors and wheels "
            "have larger errors. A trial belongs to the first class that fits:"
        ),
        Listing([f"{name}: {MEANINGS[name]}" for name in MEANINGS if name in seen]),
        Paragraph(
            "Whole lap is the share of all trials that go all round the arena without "
            f"a crash and are near walls for {FOLLOWING_SHARE:.0%} of the time since "
            "the first wall (median over runs). Few trials are long enough for a lap: "
            "in the 30 s of the paper's experiments a robot drives 3.9 m at top speed, "
            "once round the paper's arena is 3.5 m, and the robot has to find the "
            "first wall before that."
        ),
        *(
            block
            for robot in shown_robots(data)
            for block in (
                Heading(f"Behaviour, {robot_name(robot)}", 3),
                _table(data, robot, seen),
            )
        ),
    ]


def _table(data: StudyData, robot: str, seen: Sequence[str]) -> Table:
    """Behaviour on a robot: a row per experiment, the follower written by hand last."""
    rows = []
    for name in data.with_runs:
        shares, near = class_means(data, name, robot), clearances(data, name, robot)
        rows.append(
            (
                label(data, name),
                *(percent(shares.get(c, 0.0) if shares else None) for c in seen),
                spread(near, 1000),
                f"{(near < HUG).sum()} of {near.size}",
                percent_median(whole_laps(data, name, robot)),
            )
        )
    test = data.yardstick.get(robot)
    if test and test.behaviour:
        near = test.clearance
        rows.append(
            (
                YARDSTICK_LABEL,
                *(percent(test.behaviour.get(c, 0.0)) for c in seen),
                NOTHING if math.isnan(near) else f"{near * 1000:.1f}",
                NOTHING,
                percent(test.whole_laps),
            )
        )
    return Table(
        (
            "experiment",
            *(f"{each} [%]" for each in seen),
            "clearance [mm]",
            f"runs below {HUG * 1000:.0f} mm",
            "whole lap [%]",
        ),
        rows,
    )
