"""What stored fitness promised: stored against held-out fitness."""

import numpy as np

from evolution.pages.blocks import Block, Heading, Paragraph, Table
from evolution.pages.words import NOTHING, label, robot_name, spread
from evolution.report.samples import (
    best_stored_fitness,
    best_stored_robot,
    like_for_like,
    with_noise,
)
from evolution.study.data import StudyData

WITH_NOISE = (
    "Experiments that evolved with noise are compared with fresh starts with the same "
    "noise, if their champions were tested with it."
)


FITNESSES = (
    *("champion: stored", "champion: held-out", "champion: too high by"),
    *("highest: stored", "highest: held-out", "highest: too high by"),
    "regained",
)
"""Columns of fitness."""


def what_stored_fitness_promised_section(data: StudyData) -> list[Block]:
    """Blocks that compare stored fitness with fitness on fresh starts."""
    robot = best_stored_robot(data)
    noisy = any(with_noise(data, name) for name in data.with_runs)
    rows = []
    for name, runs in data.with_runs.items():
        stored, held_out = data.stored(name), like_for_like(data, name)
        tested = np.isfinite(held_out)
        stored_fitness, worth = best_stored_fitness(data, name)
        # for each run, if every run has both
        both = held_out[tested].size == worth.size
        rows.append(
            (
                label(data, name),
                str(len(runs)),
                spread(stored),
                spread(held_out[tested]),
                spread((stored - held_out)[tested]),
                spread(stored_fitness),
                spread(worth),
                spread(stored_fitness - worth),
                spread(held_out[tested] - worth) if both else NOTHING,
            )
        )
    return [
        Heading("What stored fitness promised"),
        Paragraph(
            f"On the {robot_name(robot)}: stored and held-out fitness of the champion, "
            "then of the individual with the highest stored fitness of the run "
            "(highest). Stored fitness is too high, because it is the highest of many "
            "noisy evaluations. Regained: how much more held-out fitness the champion, "
            "chosen on validation starts, has than that individual, for each run."
            + (f" {WITH_NOISE}" if noisy else "")
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
