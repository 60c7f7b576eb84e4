"""The findings of a report, per experiment: fitness, rungs, luck and behaviour."""

import math

import numpy as np

from epuck_mj.trials.behaviour_classes import HUG, MEANINGS
from epuck_mj.trials.metrics import FOLLOWING_SHARE
from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table
from evolution.pages.words import (
    NOTHING,
    SPREAD,
    YARDSTICK_LABEL,
    label,
    percent,
    robot_name,
    spread,
)
from evolution.report.samples import (
    class_means,
    clearances,
    crash_rates,
    disturbed,
    kept,
    like_for_like,
    most_believed,
    tests_of,
    whole_laps,
)
from evolution.report.tables import shown_robots
from evolution.statistics.samples import FEWEST_FOR_RANKS, rank_correlation
from evolution.study.data import StudyData


def held_out_fitness(data: StudyData) -> list[Block]:
    """The main table: held-out fitness first."""
    robots = shown_robots(data)
    rows = []
    for name, runs in data.with_runs.items():
        row = [label(name), str(len(runs))]
        for robot in robots:
            sample = data.held_out(name, robot)
            crashes = crash_rates(tests_of(data, name, robot))
            row += [spread(sample), f"{sample.max():.1f}", _percent_median(crashes)]
        rows.append([*row, spread(data.best_stored(name))])
    if data.yardstick:
        row = [YARDSTICK_LABEL, NOTHING]
        for robot in robots:
            test = data.yardstick[robot]
            row += [f"{test.mean:.1f}", NOTHING, percent(test.crash_rate)]
        rows.append([*row, NOTHING])
    columns = ["experiment", "n"]
    for robot in robots:
        columns += [f"held-out, {robot_name(robot)}", "best run", "crashes"]
    return [
        Heading("Held-out fitness"),
        Paragraph(
            f"{SPREAD} of the champion's mean on the test starts, the best run, and "
            "the median share of its trials that crash. Best stored is last: the "
            "highest fitness that a run believed in, a mean of few trials that was "
            "chosen for being high. It is what the paper reports, and seldom the "
            "champion's."
        ),
        Table([*columns, "best stored"], rows),
        *_as_evolved(data),
    ]


def _as_evolved(data: StudyData) -> list[Block]:
    """The same on disturbed robots, of experiments that evolved on such."""
    rows = []
    for name, runs in data.with_runs.items():
        found = [run.scores.held_out_as_evolved for run in runs]
        tests = [each for each in found if each]
        if tests:
            row = [label(name), str(len(tests))]
            for robot in shown_robots(data):
                on_robot = [each[robot] for each in tests]
                row.append(spread(np.array([test.mean for test in on_robot])))
                row.append(_percent_median(crash_rates(on_robot)))
            rows.append(row)
    if not rows:
        return []
    columns = ["experiment", "n"]
    for robot in shown_robots(data):
        columns += [f"held-out, {robot_name(robot)}", "crashes"]
    return [
        Paragraph(
            "The same with the disturbances that they evolved with: noise, and where "
            "the config says so other robots."
        ),
        Table(columns, rows),
    ]


def rungs(data: StudyData) -> list[Block]:
    """How champions keep their fitness from robot to robot; nothing for one robot."""
    if len(data.robots) < 2:
        return []
    first, last = data.robots[0], data.robots[-1]
    rows = []
    for name, runs in data.with_runs.items():
        a, b = data.held_out(name, first), data.held_out(name, last)
        rank = rank_correlation(a, b)
        rows.append(
            (
                label(name),
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
            f"Champions evolved on the {one}, tested on both from the same starts. "
            f"Kept: fitness on the {other} in percent of that on the {one}, by run. "
            "Rank correlation: Spearman's over runs, given from "
            f"{FEWEST_FOR_RANKS} runs on."
        ),
        Table(("experiment", "n", one, other, "kept", "rank correlation"), rows),
    ]


WITH_NOISE = (
    "Experiments that evolved with noise are held against fresh starts with such "
    "noise, where their champions were tested so."
)


def luck(data: StudyData) -> list[Block]:
    """What stored fitness promised and fresh starts did not keep."""
    robot = data.robots[0]
    noisy = any(disturbed(data, name) for name in data.with_runs)
    rows = []
    for name, runs in data.with_runs.items():
        stored, held_out = data.stored(name), like_for_like(data, name)
        tested = np.isfinite(held_out)
        believed, worth = most_believed(data, name)
        # by run, where every run says both
        both = held_out[tested].size == worth.size
        rows.append(
            (
                label(name),
                str(len(runs)),
                spread(stored),
                spread(held_out[tested]),
                spread((stored - held_out)[tested]),
                spread(believed),
                spread(worth),
                spread(believed - worth),
                spread(held_out[tested] - worth) if both else NOTHING,
            )
        )
    return [
        Heading("What stored fitness promised"),
        Paragraph(
            f"On the {robot_name(robot)}, which it evolved on: stored against held-out "
            "fitness of the champion, then of the individual that the run believed "
            "most in. The difference is luck: of many noisy evaluations the highest is "
            "believed. Regained: how much more the champion, chosen on validation "
            "starts, is worth by run." + (f" {WITH_NOISE}" if noisy else "")
        ),
        Table(
            (
                "experiment",
                "n",
                "champion, stored",
                "held-out",
                "luck",
                "most believed, stored",
                "held-out",
                "luck",
                "regained",
            ),
            rows,
        ),
    ]


def behaviour(data: StudyData) -> list[Block]:
    """What champions do, and how close to the wall they ride."""
    shares = {
        (name, robot): class_means(data, name, robot)
        for robot in shown_robots(data)
        for name in data.with_runs
    }
    classes = dict.fromkeys(name for each in shares.values() for name in each)
    seen = [c for c in classes if any(each.get(c) for each in shares.values())]
    if not seen:
        return [
            Heading("Behaviour"),
            Paragraph("Not known: no run has behaviour classes."),
        ]
    rows = []
    for (name, robot), each in shares.items():
        near = clearances(data, name, robot)
        rows.append(
            (
                label(name),
                robot_name(robot),
                *(percent(each.get(c, 0.0) if each else None) for c in seen),
                spread(near, 1000),
                f"{(near < HUG).sum()} of {near.size}",
                _percent_median(whole_laps(data, name, robot)),
            )
        )
    for robot in shown_robots(data):
        test = data.yardstick.get(robot)
        if test and test.behaviour:
            near = test.clearance
            rows.append(
                (
                    YARDSTICK_LABEL,
                    robot_name(robot),
                    *(percent(test.behaviour.get(c, 0.0)) for c in seen),
                    NOTHING if math.isnan(near) else f"{near * 1000:.1f}",
                    NOTHING,
                    percent(test.whole_laps),
                )
            )
    return [
        Heading("Behaviour"),
        Paragraph(
            "Share of the test trials in each class, mean over runs; mean clearance "
            "from shell to wall in mm while a wall is near, median [quartiles] over "
            f"runs; champions whose mean clearance is below {HUG * 1000:.0f} mm. A "
            "champion that rides so close is a reality gap in waiting: a real robot's "
            "sensors and wheels err by more. A trial has the first class that fits:"
        ),
        Listing([f"{name}: {MEANINGS[name]}" for name in MEANINGS if name in seen]),
        Paragraph(
            "Whole lap, median over runs: the share of all trials that go all round "
            "the arena without a crash, near walls in "
            f"{FOLLOWING_SHARE:.0%} of the time from the first on. Few trials have "
            "time for one: at top speed the 30 s of the paper's experiments are 3.9 m, "
            "once round its arena is 3.5 m, and the first wall has to be found."
        ),
        Table(
            (
                "experiment",
                "robot",
                *seen,
                "clearance [mm]",
                f"below {HUG * 1000:.0f} mm",
                "whole lap",
            ),
            rows,
            texts=2,
        ),
    ]


def _percent_median(shares: np.ndarray) -> str:
    return percent(float(np.median(shares)) if shares.size else None)
