"""Thinned histories: enough generations of each run for its curves and targets.

A run of 3,000 generations would take as much room as fifteen of 200. Of each run stay

- about `MOST` generations in even steps,
- those in which the best stored fitness rose above all before, so that the evaluations
  to any target are exact,
- the first two and the last two, and those before and after it climbed.

Control steps are summed over the generations since the row before, as far as they are
known. A table that is thinned already does not change.
"""

import numpy as np
import pyarrow as pa

from evolution.run.history import ROBOT
from evolution.study.histories import codes, slices

MOST = 60
"""Generations in even steps that stay of a run."""

ENDS = 2
"""Generations that stay at either end: `verify` makes the first two again, and the last
two say how large the last one was."""


def thinned(table: pa.Table) -> pa.Table:
    """The rows that stay of a table of histories.

    Args:
        table: with the columns of history.parquet, sorted by run and generation.
    """
    if not table.num_rows:
        return table
    generations, best = (table[name].to_numpy() for name in ("generation", "best"))
    robots = codes(table[ROBOT])
    steps = table["control_steps"].to_numpy().astype(float)
    stay = np.zeros(table.num_rows, bool)
    for run in slices(table):
        stay[run] = _stay(generations[run], best[run], robots[run])
    index = np.flatnonzero(stay)
    # a row that stays is the last of those that it stands for
    begins = np.concatenate([[0], index[:-1] + 1])
    known = np.isfinite(steps)
    summed = np.add.reduceat(np.where(known, steps, 0.0), begins)
    summed[np.add.reduceat(known.astype(int), begins) == 0] = np.nan
    column = table.schema.get_field_index("control_steps")
    kind = table.schema.field(column)
    kept = table.take(pa.array(index))
    return kept.set_column(
        column, kind, pa.array(summed, from_pandas=True).cast(kind.type)
    )


def _stay(generations: np.ndarray, best: np.ndarray, robots: np.ndarray) -> np.ndarray:
    """Which generations `(n,)` of a run stay."""
    every = -(-(int(generations[-1]) + 1) // MOST)
    climbs = np.flatnonzero(np.diff(robots))
    stay = generations % every == 0
    stay[:ENDS] = stay[-ENDS:] = True
    stay[climbs] = stay[climbs + 1] = True
    # on another robot, fitness begins again
    for part in np.split(np.arange(len(best)), climbs + 1):
        highest = np.maximum.accumulate(best[part])
        stay[part[1:]] |= np.diff(highest) > 0
    return stay
