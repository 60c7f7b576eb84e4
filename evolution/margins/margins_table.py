"""The table of margins: a row per champion, change and amount, in a Parquet file."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from epuck_mj.host import files
from evolution.margins.measuring import Margin
from evolution.study.table_files import read_table, write_table

FILE = "margins.parquet"
"""Name of the table in a study's directory."""

SCHEMA = pa.schema(
    {
        "experiment": pa.string(),
        "seed": pa.int64(),
        "change": pa.string(),
        "amount": pa.float64(),
        "fitness": pa.float64(),
        "crash_rate": pa.float64(),
    }
)
"""Columns; amounts have the units that `CHANGES` names."""


@dataclass(frozen=True, eq=False)
class Margins:
    """Margins of a study's champions, `(rows,)` each.

    Attributes:
        experiment: of the champion; `wall-follower` is the hand-written one.
        seed: of its run; 0 of the hand-written one.
        change: name in `CHANGES`.
        amount: of the change.
        fitness: mean over the starts.
        crash_rate: share of the trials that ended in a crash.
    """

    experiment: np.ndarray
    seed: np.ndarray
    change: np.ndarray
    amount: np.ndarray
    fitness: np.ndarray
    crash_rate: np.ndarray

    @property
    def experiments(self) -> list[str]:
        """Names of the experiments in their order."""
        return list(dict.fromkeys(self.experiment.tolist()))

    def of(
        self, experiment: str, change: str
    ) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
        """Each amount of a change with fitness and crash rates, `(runs,)` each."""
        rows = (self.experiment == experiment) & (self.change == change)
        for amount in np.unique(self.amount[rows]).tolist():
            these = rows & (self.amount == amount)
            yield amount, self.fitness[these], self.crash_rate[these]


def rows_of(experiment: str, seeds: Sequence[int], found: Margin) -> pa.Table:
    """Rows of the champions of an experiment on one changed robot."""
    n = len(seeds)
    columns = [
        [experiment] * n,
        list(seeds),
        [found.change] * n,
        [float(found.amount)] * n,
        found.fitness.tolist(),
        found.crash_rate.tolist(),
    ]
    return pa.table(columns, schema=SCHEMA)


def write_margins(path: Path, parts: Sequence[pa.Table]) -> None:
    """Write rows to a file; equal rows give equal bytes.

    Raises:
        UserError: if it cannot be written.
    """
    with files.writing():
        write_table(path, pa.concat_tables(parts))


def read_margins(path: Path) -> Margins | None:
    """The margins in a file; None if it is not there.

    Raises:
        UserError: if it is something else.
    """
    if not files.is_file(path):
        return None
    table = read_table(path, SCHEMA.names)
    columns = {name: np.array(table[name].to_pylist()) for name in SCHEMA.names}
    return Margins(**columns)
