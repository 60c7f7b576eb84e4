"""Screen: one status line for each robot, rewritten on a terminal."""

import contextlib
import shutil
import sys
import time
from collections.abc import Sequence

from epuck_mj.bridge.drive.console import FLEET_HEADING, QUIET_PERIOD
from epuck_mj.host.output import Output, OutputLost

PERIOD = 0.1
"""Time between two drawings of a terminal [s]."""


class Screen:
    """Status lines of a fleet, and what is said beside them."""

    def __init__(self, output: Output, names: Sequence[str]) -> None:
        """Show nothing yet.

        Args:
            output: standard output.
            names: of the robots, in the order of their lines.
        """
        self._output = output
        self._live = sys.stdout.isatty()
        self._width = max(len("robot"), *map(len, names))
        self._lines = dict.fromkeys(names, "")
        self._said: dict[str, float] = {}
        self._drawn = 0
        self._at = -PERIOD

    def say(self, text: str) -> None:
        """Say something that stays."""
        self._write(f"{self._erased()}{text}")

    def head(self) -> None:
        """Say what the status lines mean."""
        self.say(self._named("robot", FLEET_HEADING))

    def line(self, name: str, text: str) -> None:
        """Show a robot's status."""
        self._lines[name] = text
        now = time.monotonic()
        if not self._live and now >= self._said.get(name, 0.0) + QUIET_PERIOD:
            self._said[name] = now
            self._write(self._named(name, text))

    def over(self, name: str, text: str) -> None:
        """Show why a robot has ended, where it had its status."""
        self._lines[name] = text

    def draw(self) -> None:
        """Draw the status lines on a terminal, if it is time for that."""
        now = time.monotonic()
        if not self._live or now < self._at + PERIOD:
            return
        self._at = now
        # a line that is wrapped would be two
        columns = shutil.get_terminal_size().columns - 1
        lines = [self._named(*line)[:columns] for line in self._lines.items()]
        text = "\n".join(lines)
        erased, self._drawn = self._erased(), len(lines)
        self._write(f"{erased}{text}")

    @property
    def lost(self) -> bool:
        """Whether standard output is closed, so nobody sees the screen."""
        return self._output.lost

    def _write(self, text: str) -> None:
        # the fleet checks `lost`
        with contextlib.suppress(OutputLost):
            self._output.say(text)

    def _erased(self) -> str:
        """What moves the cursor before the lines that are drawn, and erases them."""
        drawn, self._drawn = self._drawn, 0
        return f"\x1b[{drawn}A\r\x1b[J" if drawn else ""

    def _named(self, name: str, text: str) -> str:
        return f"{name:{self._width}} {text}"
