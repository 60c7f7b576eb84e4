"""Progress of a run: a bar on a terminal, a line now and then elsewhere."""

import sys
import threading
from typing import TYPE_CHECKING, Any, Self

from tqdm import tqdm

from epuck_mj.scene.model_files import WHEELED_ROBOT

if TYPE_CHECKING:
    from evolution.run.generation_loop import Record

LINES = 20
"""Lines that the generations of a run print where there is no terminal."""

TICK = 0.5
"""Time between two updates of a bar's clock [s]."""


class Progress:
    """Shows how far a run is: its generations, then the stages that choose a champion.

    On a terminal the clock of the bar goes on between two updates.
    """

    def __init__(self):
        """Show that the run is being prepared."""
        self._budget = self._next_line = 0
        self._terminal = sys.stderr.isatty()
        self._bar = self._new_bar(
            desc="Loading the simulator", bar_format="{desc} [{elapsed}]", leave=False
        )
        self._ended, self._replacing = threading.Event(), threading.Lock()
        self._clock = threading.Thread(target=self._tick, daemon=True)
        if self._terminal:
            self._clock.start()

    def begin(self, budget: int, done: int, wheels: str = WHEELED_ROBOT) -> None:
        """Show the generations from now on, at `done` of `budget` evaluations.

        Args:
            budget: evaluations of the run.
            done: evaluations so far.
            wheels: robot that the run climbs to.
        """
        self._budget, self._next_line, self._wheels = budget, done, wheels
        self._replace_bar(total=budget, initial=done, unit="eval")

    def update(self, record: "Record") -> None:
        """Show one more generation."""
        figures = {
            "gen": str(record.generation),
            "best": f"{record.best:.1f}",
            "mean": f"{record.mean:.1f}",
            "crash": f"{record.crash_rate:.0%}",
        }
        if record.climbed:
            figures["robot"] = self._wheels
        if self._terminal:
            self._bar.set_postfix(figures, refresh=False)
            self._bar.update(record.evaluations - self._bar.n)
        elif record.evaluations >= self._next_line:
            text = " ".join(f"{name}={value}" for name, value in figures.items())
            line = f"{record.evaluations:>6} of {self._budget} evaluations: {text}"
            print(line, file=sys.stderr, flush=True)
            self._next_line += self._budget / LINES

    def stage(self, text: str, number: int, stages: int) -> None:
        """Show that the next stage of choosing the champion begins.

        Args:
            text: what is done in it.
            number: of the stage, from 0 on.
            stages: how many there are.
        """
        if not self._terminal:
            print(f"{text} ...", file=sys.stderr, flush=True)
            return
        if number == 0:
            self._replace_bar(total=stages, unit="stage")
        self._bar.update(number - self._bar.n)
        self._bar.set_description(text)

    def _new_bar(self, **options: Any) -> tqdm:
        return tqdm(dynamic_ncols=True, disable=not self._terminal, **options)

    def _replace_bar(self, **options: Any) -> None:
        with self._replacing:
            self._bar.close()
            self._bar = self._new_bar(**options)

    def _tick(self) -> None:
        """Redraw the bar until the end."""
        while not self._ended.wait(TICK):
            # a bar that is closed must not be drawn again
            with self._replacing:
                self._bar.refresh()

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def close(self) -> None:
        """Leave the terminal tidy; nothing is shown any more."""
        self._ended.set()
        if self._clock.is_alive():
            self._clock.join()
        self._bar.close()

    def __exit__(self, *exception: object) -> None:
        """See `close`."""
        self.close()
