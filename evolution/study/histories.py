"""The table of histories, history.parquet: rows of a run's generations."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.csv_text import csv_columns
from evolution.run.directory import RunDirectory
from evolution.run.history import (
    CLIMBED,
    HISTORY,
    ROBOT,
    read_history,
    table_text,
)

RunKey = tuple[str, int]
"""Experiment and seed."""

COUNTED = ("control_steps", "crash_rate")
"""Columns that older runs did not count; nan there."""

SCHEMA = pa.schema(
    [
        ("experiment", pa.string()),
        ("seed", pa.int64()),
        ("generation", pa.int64()),
        ("evaluations", pa.int64()),
        ("best", pa.float64()),
        ("mean", pa.float64()),
        ("std", pa.float64()),
        (ROBOT, pa.string()),
        ("control_steps", pa.int64()),
        ("crash_rate", pa.float64()),
    ]
)
"""Columns of history.parquet; the last two are null where they are not known."""

History = Mapping[str, np.ndarray]
"""Columns of a run by name, `(generations,)` each: those of `read_history`, the name of
the robot, and those of `COUNTED`."""


def history_of(directory: RunDirectory, robot: str) -> tuple[History, str]:
    """The history of a run from its directory, and what of it is not known.

    Args:
        directory: of the run.
        robot: with which it began, which older histories do not say.

    Returns:
        It, and a line if timing.csv cannot be read: only `COUNTED` is lost then.

    Raises:
        UserError: if history.csv cannot be read, or is damaged.
    """
    columns = read_history(directory.history)
    robots = csv_columns(files.read_text(directory.history)).get(ROBOT)
    n = len(columns["generation"])
    counted, note = {name: np.full(n, np.nan) for name in COUNTED}, ""
    try:
        for name, values in counted.items():
            for generation, value in _of_generations(directory.timing, name).items():
                values[range(n)[generation]] = value
    except (UserError, ValueError, IndexError) as error:
        note = f"'{directory.timing}' is damaged: {error}"
        counted = {name: np.full(n, np.nan) for name in COUNTED}
    return {**columns, ROBOT: np.array(robots or [robot] * n), **counted}, note


def seconds_of(directory: RunDirectory) -> float:
    """Seconds of all generations of a run whose time is known."""
    try:
        return sum(_of_generations(directory.timing, "seconds").values())
    except (UserError, ValueError):
        return 0.0


def _of_generations(timing: Path, column: str) -> dict[int, float]:
    """What timing.csv says, by generation; the last of one that was done twice.

    Raises:
        UserError: if it cannot be read.
        ValueError: if it says something else.
    """
    columns = csv_columns(table_text(timing))
    numbers, texts = (columns.get(name, []) for name in ("generation", column))
    found = {
        int(number): float(text)
        for number, text in zip(numbers, texts, strict=False)
        if text
    }
    if not all(math.isfinite(value) for value in found.values()):
        raise ValueError(f"expected finite {column}")
    return found


def history_table(histories: Mapping[RunKey, History]) -> pa.Table:
    """The table of some runs' histories."""
    parts = [_part(*run, history) for run, history in histories.items()]
    return pa.concat_tables([SCHEMA.empty_table(), *parts])


def _part(experiment: str, seed: int, history: History) -> pa.Table:
    n = len(history["generation"])
    columns = {
        "experiment": pa.array([experiment] * n, pa.string()),
        "seed": np.full(n, seed),
        **history,
    }
    arrays = [
        # nan stands for unknown values
        pa.array(columns[field.name], from_pandas=True).cast(field.type)
        for field in SCHEMA
    ]
    return pa.Table.from_arrays(arrays, schema=SCHEMA)


def histories_in(table: pa.Table) -> dict[RunKey, History]:
    """The histories of a sorted table, by run.

    Raises:
        ValueError: if a history is damaged.
    """
    columns = {
        name: table[name].to_numpy() for name in table.column_names if name != ROBOT
    }
    robots = np.asarray(table[ROBOT].to_pylist())
    found: dict[RunKey, History] = {}
    for part in slices(table):
        first = part.start
        history = {
            name: columns[name][part].astype(float) for name in (*HISTORY, *COUNTED)
        }
        history[ROBOT] = robots[part]
        history[CLIMBED] = (robots[part] != robots[first]).astype(float)
        run = str(columns["experiment"][first]), int(columns["seed"][first])
        rises = (np.diff(history["evaluations"], prepend=0) > 0).all()
        finite = all(np.isfinite(history[name]).all() for name in HISTORY)
        if run in found or not rises or not finite:
            raise ValueError(f"the history of {run[0]} seed {run[1]} is invalid")
        found[run] = history
    return found


def slices(table: pa.Table) -> list[slice]:
    """Rows of each run in a sorted table."""
    if not table.num_rows:
        return []
    changes = np.diff(codes(table["experiment"])) != 0
    changes |= np.diff(table["seed"].to_numpy()) != 0
    bounds = [0, *(np.flatnonzero(changes) + 1).tolist(), table.num_rows]
    return [slice(*ends) for ends in pairwise(bounds)]


def codes(column: pa.ChunkedArray) -> np.ndarray:
    """A number for each text of a column, equal for equal ones, `(rows,)`."""
    return column.combine_chunks().dictionary_encode().indices.to_numpy()


def merged(
    parts: Sequence[pa.Table], kept: Collection[RunKey], order: Sequence[str]
) -> pa.Table:
    """The rows of the runs to be kept, by experiment, seed and generation.

    Args:
        parts: tables; of a run in several of them, the last one counts.
        kept: runs that are kept.
        order: names of experiments.
    """
    wanted, chosen = set(kept), []
    for part in reversed(parts):
        runs = _runs(part)
        mask = np.array([run in wanted for run in runs], bool)
        chosen.append(part.filter(pa.array(mask, pa.bool_())))
        wanted -= set(runs)
    whole = pa.concat_tables([SCHEMA.empty_table(), *chosen])
    rank = {name: i for i, name in enumerate(order)}
    ranks = np.array([rank[name] for name in whole["experiment"].to_pylist()], int)
    keys = whole["generation"].to_numpy(), whole["seed"].to_numpy(), ranks
    return whole.take(pa.array(np.lexsort(keys)))


def _runs(table: pa.Table) -> list[RunKey]:
    """The run of each row."""
    names: Iterable[str] = table["experiment"].to_pylist()
    return list(zip(names, table["seed"].to_pylist(), strict=True))


def checked(table: pa.Table, path: Path) -> pa.Table:
    """A table that was read, with the columns of `SCHEMA` only.

    Raises:
        UserError: if its columns are of other types.
    """
    try:
        found = table.select(SCHEMA.names).cast(SCHEMA)
        unknown = [n for n in SCHEMA.names[:-2] if found[n].null_count]
        if unknown:
            raise ValueError(f"a value of {unknown[0]} is missing")
    except (pa.ArrowException, ValueError) as error:
        reason = " ".join(str(error).split())
        raise UserError(f"'{path}' is damaged: {reason}") from None
    return found
