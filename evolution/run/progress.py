"""Progress of a run: a bar on a terminal, a line now and then elsewhere."""

import sys
from typing import Self

from tqdm import tqdm

from evolution.run.generation_loop import Record

LINES = 20
"""Lines that a whole run prints where there is no terminal."""


class Progress:
    """Shows the records of a run as they come."""

    def __init__(self, budget: int, done: int):
        """Start at `done` of `budget` evaluations."""
        self._budget = budget
        self._next_line = done
        self._terminal = sys.stderr.isatty()
        self._bar = tqdm(
            total=budget,
            initial=done,
            unit="eval",
            dynamic_ncols=True,
            disable=not self._terminal,
        )

    def update(self, record: Record) -> None:
        """Show one more generation."""
        figures = {
            "gen": str(record.generation),
            "best": f"{record.best:.1f}",
            "mean": f"{record.mean:.1f}",
            "crash": f"{record.crash_rate:.0%}",
        }
        if self._terminal:
            self._bar.set_postfix(figures, refresh=False)
            self._bar.update(record.evaluations - self._bar.n)
        elif record.evaluations >= self._next_line:
            text = " ".join(f"{name}={value}" for name, value in figures.items())
            line = f"{record.evaluations:>6} of {self._budget} evaluations: {text}"
            print(line, file=sys.stderr, flush=True)
            self._next_line += self._budget / LINES

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Leave the terminal tidy."""
        self._bar.close()
