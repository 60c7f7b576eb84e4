"""A drive of a fleet: all robots answer, all start; each can end alone, or all end.

The keyboard and the signals are this process's: one key stops all.
"""

import contextlib
import signal
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from epuck_mj.bridge.drive.keyboard import STOP_KEYS, Keyboard, keyboard
from epuck_mj.bridge.drive.log import Show, log_file, show_log
from epuck_mj.bridge.drive.order import Order
from epuck_mj.bridge.failures import DONE, FAILED, RUNAWAY
from epuck_mj.bridge.fleet.crew import NOT_ENDED, Crew, Report
from epuck_mj.bridge.fleet.driver import LINE, MET, OVER, SAID
from epuck_mj.bridge.fleet.screen import Screen
from epuck_mj.errors import UserError
from epuck_mj.host.interruption import Interruption
from epuck_mj.host.output import OUTPUT_LOST, Output, OutputLost, complain, say
from epuck_mj.trials.trajectory import Trajectory

MEETING_TIME_MAX = 60.0
"""Time after which a robot whose process has not met it is given up [s]. Chosen.

Opening a port and greeting take at most CONNECT_TIME_MAX each; a slow computer takes
most of the time to start forty processes.
"""

POLL_TIME = 0.02
"""Time between two looks at keys and signals [s]."""

START_KEYS = b"\r\n"
"""Enter, as terminals send it."""

NOT_ALL = "not all robots answered"

ASKED = 128 + signal.SIGTERM
"""Exit status of a driver that was told to stop, and did."""

NOT_STARTED = 2
"""Exit status of a fleet that did not drive, since a robot did not answer."""


@dataclass(frozen=True)
class End:
    """How a robot's drive ended.

    Attributes:
        status: exit status of its driver.
        word: why, on one line.
        facts: summary of the drive, on one line; empty if it did not begin.
        alone: whether it ended by itself, before all were stopped.
    """

    status: int
    word: str
    facts: str
    alone: bool

    @property
    def failed(self) -> bool:
        """Whether it ended in another way than was planned or asked for."""
        asked = () if self.alone else (ASKED,)
        return self.status not in (DONE, *asked)


class FleetDrive:
    """A drive of a fleet under way.

    Attributes:
        ends: how robots' drives ended, by name.
        begun: whether they were let go.
        stopped: why all were stopped; empty if they were not.
    """

    def __init__(
        self, crew: Crew, screen: Screen, keys: Keyboard, interruption: Interruption
    ) -> None:
        """Begin nothing yet."""
        self._crew = crew
        self._screen = screen
        self._keys = keys
        self._had_keys = keys.there
        self._interruption = interruption
        self._met: dict[str, str] = {}
        self._over: dict[str, Report] = {}
        self._late: set[str] = set()
        self._pressed = b""
        self.ends: dict[str, End] = {}
        self.begun = False
        self.stopped = ""

    def run(self, orders: Mapping[str, Order]) -> None:
        """Meet the robots that have orders, start them, and let them drive."""
        deadline = time.monotonic() + MEETING_TIME_MAX

        def missing() -> set[str]:
            return set(orders) - self._met.keys() - self.ends.keys()

        self._until(lambda: not missing() or time.monotonic() > deadline)
        self._late = missing()
        for name in orders:
            if name in self._met:
                port = orders[name].port
                self._screen.say(f"{name} at {port}: {self._met[name]}")
        ready = not (self.ends or self._late or self.stopped)
        if self._keys.there and ready:
            self._screen.say(
                f"All {len(orders)} robots answer. Put each where it is to start.\n"
                "Enter starts all of them. q, space or Ctrl-C ends."
            )
            self._until(
                lambda: bool(self.ends) or any(k in self._pressed for k in START_KEYS)
            )
        if self.ends or self._late or self.stopped:
            self.stopped = self.stopped or NOT_ALL
            return
        keys = "q, space or " if self._keys.there else ""
        self._screen.say(f"{keys}Ctrl-C stops all.")
        self._screen.head()
        self.begun = True
        self._crew.go()
        self._until(lambda: not self._crew.there)

    def hear(self, report: Report) -> None:
        """Handle the report of a driver."""
        name, text = report.name, report.text
        if report.kind == MET:
            self._met[name] = text
        elif report.kind == LINE:
            self._screen.line(name, text)
        elif report.kind == SAID:
            self._screen.say(f"{name}: {text}")
        elif report.kind == OVER:
            self._over[name] = report
        else:
            self._end(report)

    def _end(self, report: Report) -> None:
        """Remember how a driver ended, and say so if others drive on."""
        name, said = report.name, self._over.get(report.name, report)
        alone, word = not self.stopped, said.text
        if name in self._late and self.stopped == NOT_ALL:
            alone, word = True, f"not met in {MEETING_TIME_MAX:.0f} s, and given up"
        self.ends[name] = End(report.status, word, said.facts, alone)
        if alone and self.begun:
            self._screen.say(f"{name}: {said.text}")
            self._screen.over(name, said.text)

    def _until(self, done: Callable[[], bool]) -> None:
        """Listen, and look at keys and signals, until done or all have to stop."""
        while not self.stopped and not done():
            report = self._crew.report(POLL_TIME)
            while report is not None:
                self.hear(report)
                report = self._crew.report(0.0)
            self._screen.draw()
            self._pressed = self._keys.pressed()
            if self._interruption.signum is not None:
                self.stopped = self._interruption.signum.name
            elif any(key in self._pressed for key in STOP_KEYS):
                self.stopped = "the operator's key"
            elif self._screen.lost or (self._had_keys and not self._keys.there):
                self.stopped = "the loss of the terminal"

    @property
    def status(self) -> int:
        """Exit status of the fleet."""
        if any(end.status == RUNAWAY for end in self.ends.values()):
            return RUNAWAY
        if self._interruption.signum is not None:
            return self._interruption.status
        if self._screen.lost or (self._had_keys and not self._keys.there):
            return OUTPUT_LOST
        if any(end.failed for end in self.ends.values()):
            return FAILED if self.begun else NOT_STARTED
        return DONE


def drive_fleet(orders: Mapping[str, Order], shows: Mapping[str, Show]) -> int:
    """Drive robots, stop them, write their logs, and return the exit status.

    Args:
        orders: by the robots' names.
        shows: what writes the pictures of each log, when all robots stand.

    Raises:
        UserError: if all went well, but a log or a picture could not be written.
    """
    with (
        Output(sys.stdout) as output,
        Interruption() as interruption,
        keyboard() as keys,
    ):
        screen = Screen(output, list(orders))
        crew = Crew(orders)
        fleet = FleetDrive(crew, screen, keys, interruption)
        with crew:
            fleet.run(orders)
            crew.stop()
            crew.await_end(fleet.hear)
        for name in orders.keys() - fleet.ends.keys():
            fleet.ends[name] = End(RUNAWAY, NOT_ENDED, "", True)
        status = fleet.status
    # before pictures take time
    for name in orders:
        end = fleet.ends[name]
        if end.failed:
            complain(f"error: {name}: {end.word.removeprefix('error: ')}")
    word = _word(fleet)
    if interruption.signum is not None:
        complain(f"{interruption.signum.name}: {word}")
    elif status == OUTPUT_LOST:
        complain(f"error: {word}")
    failure = None
    with contextlib.suppress(OutputLost):
        say(f"{word}\nwriting pictures ..." if fleet.begun else word)
    for name, show in shows.items():
        unshown = _show(name, fleet.ends[name], Path(orders[name].log), show)
        failure = failure or unshown
    if failure is not None and not status:
        raise failure
    if failure is not None:
        complain(f"error: {failure}")
    return status


def _word(fleet: FleetDrive) -> str:
    """How the drive of a fleet ended."""
    if not fleet.begun:
        return "no robot was driven"
    if any(end.status == RUNAWAY for end in fleet.ends.values()):
        return "ended, but a robot may still drive"
    why = f"stopped by {fleet.stopped}" if fleet.stopped else "ended"
    return f"{why}; all robots stand still"


def _show(name: str, end: End, log: Path, show: Show) -> UserError | None:
    """Write the pictures of a robot's log and say how it did; why some are missing."""
    if not end.facts:
        return None
    try:
        trajectory = Trajectory.load(log_file(log, ".npz"))
    except UserError as error:
        return error
    files, failure = show_log(log, trajectory, show, end.facts)
    with contextlib.suppress(OutputLost):
        say(f"{name}: {end.facts}; {files[-1]}")
    return failure
