"""What stored fitness promised: the luck in it, which fresh starts do not keep."""

import numpy as np

from evolution.pages.blocks import Block, Heading, Paragraph, Table
from evolution.pages.words import NOTHING, label, robot_name, spread
from evolution.report.samples import (
    believed_on,
    like_for_like,
    most_believed_fitness,
    with_noise,
)
from evolution.study.data import StudyData

WITH_NOISE = (
    "Experiments that evolved with noise are held against fresh starts with such "
    "noise, where their champions were tested so."
)


FITNESSES = (
    *("champion: stored", "champion: held-out", "champion: luck"),
    *("most believed: stored", "most believed: held-out", "most believed: luck"),
    "regained",
)
"""Columns of fitness."""


def what_stored_fitness_promised_section(data: StudyData) -> list[Block]:
    """What stored fitness promised and fresh starts did not keep."""
    robot = believed_on(data)
    noisy = any(with_noise(data, name) for name in data.with_runs)
    rows = []
    for name, runs in data.with_runs.items():
        stored, held_out = data.stored(name), like_for_like(data, name)
        tested = np.isfinite(held_out)
        believed, worth = most_believed_fitness(data, name)
        # by run, where every run says both
        both = held_out[tested].size == worth.size
        rows.append(
            (
                label(data, name),
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
            f"On the {robot_name(robot)}: stored against held-out "
            "fitness of the champion, then of the individual that the run believed "
            "most in. The difference is luck: of many noisy evaluations the highest is "
            "believed. Regained: how much more the champion, chosen on validation "
            "starts, is worth by run." + (f" {WITH_NOISE}" if noisy else "")
        ),
        Table(
            (
                "experiment",
                "runs",
                *(f"{each} [of {data.steps}]" for each in FITNESSES),
            ),
            rows,
        ),
    ]
