"""Histories of a run: history.csv, best_individuals.npz and timing.csv."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.csv_text import csv_columns, csv_text
from epuck_mj.scene.model_files import on_wheels


@dataclass(frozen=True)
class Record:
    """Record of one generation: fitness, then cost.

    Attributes:
        generation: counted from 0, the initial population.
        evaluations: individuals evaluated so far.
        best: highest stored fitness of the population.
        mean: mean stored fitness of the population.
        std: its standard deviation.
        control_steps: of all its trials together; racing makes them fewer.
        crash_rate: share of its trials that ended in a crash; racing breaks some off
            before they can.
        climbed: whether its trials were on wheels in MuJoCo, after others that were
            not.
    """

    generation: int
    evaluations: int
    best: float
    mean: float
    std: float
    control_steps: int
    crash_rate: float
    climbed: bool = False


HISTORY: tuple[str, ...] = ("generation", "evaluations", "best", "mean", "std")
"""Columns of history.csv with numbers: racing changes none of them."""

ROBOT, CLIMBED = "robot", "climbed"
"""Last column of history.csv, the robot of the generation's trials; and what
`read_history` makes of it: 1 where it is another robot than at first, else 0."""


def history_text(records: Sequence[Record], robot: str) -> str:
    """Text of history.csv, without times, with floats that read back exactly.

    Args:
        records: of all generations.
        robot: with which the run began.
    """
    climbed = on_wheels(robot)
    rows = (
        {name: getattr(record, name) for name in HISTORY}
        | {ROBOT: climbed if record.climbed else robot}
        for record in records
    )
    return csv_text([*HISTORY, ROBOT], rows)


def read_history(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history.csv, `(generations,)` each.

    Instead of the robot, `climbed` is 1 where it is another than at first, else 0.

    Raises:
        UserError: if it cannot be read, or is damaged.
    """
    text = files.read_text(path)
    try:
        texts = csv_columns(text)
        known = [(*HISTORY,), (*HISTORY, ROBOT)]
        if tuple(texts) not in known or not texts[HISTORY[0]]:
            raise ValueError(f"expected rows of {','.join(HISTORY)}")
        columns = {name: np.array(texts[name], float) for name in HISTORY}
        # older histories do not say which robot it was
        robots = texts.get(ROBOT, [""] * len(texts[HISTORY[0]]))
        columns[CLIMBED] = np.array([each != robots[0] for each in robots], float)
        spent = np.diff(columns["evaluations"], prepend=0)
        finite = all(np.isfinite(each).all() for each in columns.values())
        if (spent <= 0).any() or not finite:
            raise ValueError("evaluations do not rise, or a value is not finite")
    except ValueError as error:
        raise UserError(f"'{path}' is damaged: {error}") from None
    return columns


def read_best_individuals(path: Path, n_genes: int) -> tuple[np.ndarray, np.ndarray]:
    """Genomes `(generations, n_genes)` and fitness `(generations,)` of the best.

    Raises:
        UserError: if they cannot be read, or are something else.
    """
    best = files.read_arrays(path)
    genomes, fitness = (best.get(name, np.empty(0)) for name in ("genomes", "fitness"))
    n = fitness.size
    if not n or fitness.shape != (n,) or genomes.shape != (n, n_genes):
        raise UserError(
            f"'{path}': expected genomes (generations, {n_genes}) and fitness "
            f"(generations,), got {genomes.shape} and {fitness.shape}"
        )
    for array in (genomes, fitness):
        if array.dtype != float or not np.isfinite(array).all():
            raise UserError(f"'{path}': expected finite numbers")
    return genomes, fitness


def timing_text(
    records: Sequence[Record], seconds: Sequence[float], before: Path
) -> str:
    """Text of timing.csv; seconds are empty where a kill lost them.

    Args:
        records: of all generations.
        seconds: that each of the last generations took.
        before: the file so far, which knows the others' seconds.
    """
    taken: dict[int, str] = {}
    if files.is_file(before):
        columns = {}
        with suppress(ValueError):
            columns = csv_columns(before.read_text(encoding="utf-8", errors="replace"))
        numbers, each = (columns.get(name, []) for name in ("generation", "seconds"))
        for number, text in zip(numbers, each, strict=False):
            # ignore a row that was cut off
            with suppress(ValueError):
                taken[int(number)] = f"{float(text):.3f}"
    first = len(records) - len(seconds)
    taken |= {first + i: f"{each:.3f}" for i, each in enumerate(seconds)}
    rows = (
        {
            "generation": record.generation,
            "seconds": taken.get(record.generation),
            "control_steps": record.control_steps,
            "crash_rate": f"{record.crash_rate:.4f}",
        }
        for record in records
    )
    return csv_text(["generation", "seconds", "control_steps", "crash_rate"], rows)


def table_text(path: Path) -> str:
    """The text of a table beside a history; empty if there is none."""
    return files.read_text(path) if files.is_file(path) else ""
