"""The crew: the drivers of a fleet, one process for each robot.

A driver's standard input says go; its end says stop, and comes by itself if this
process is killed. Nothing that happens to one driver reaches another.
"""

import contextlib
import json
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import IO

from epuck_mj.bridge.drive.order import Order
from epuck_mj.bridge.failures import RUNAWAY
from epuck_mj.bridge.fleet.driver import GO, MODULE, OVER, SAID
from epuck_mj.bridge.line.last_resort import leave_to_last_resort

END_TIME_MAX = 5.0
"""Time after which a driver that was told to stop is killed [s]. Chosen.

Stopping takes at most STOP_TIME_MAX; closing a port and writing a log take longer. When
a driver is killed, its guardian stops the robot.
"""

LOOK = "THE MOTORS MAY STILL TURN: look, and switch it off if they do."

NOT_ENDED = f"error: its process did not end. {LOOK}"
"""Word of a robot whose driver cannot be killed."""

GONE = "gone"
"""Kind of report that a process makes for a driver: it has ended."""


@dataclass(frozen=True)
class Report:
    """What a driver says, or what is said of it when it has ended.

    Attributes:
        name: of its robot.
        kind: MET, LINE, SAID or OVER of `driver`, or GONE.
        text: for a person.
        facts: summary of a drive that is over.
        status: exit status of a driver that has ended.
    """

    name: str
    kind: str
    text: str
    facts: str = ""
    status: int = 0


class Crew:
    """Drivers of some robots; the end of its `with` block stops all of them.

    Attributes:
        there: names of the robots whose drivers have not ended.
    """

    def __init__(self, orders: Mapping[str, Order]) -> None:
        """Store orders by the robots' names; nothing is started yet."""
        self._orders = orders
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._reports: queue.Queue[Report] = queue.Queue()
        self.there: set[str] = set()

    def __enter__(self) -> "Crew":
        """Start the drivers, which greet their robots."""
        try:
            for name, order in self._orders.items():
                self._start(name, order)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop all; those that do not end are killed, and their guardians stop them."""
        self.stop()
        self.await_end(lambda report: None)

    def _start(self, name: str, order: Order) -> None:
        process = subprocess.Popen(
            [sys.executable, "-m", MODULE, order.to_json()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C on a terminal is for the fleet, which stops them
            start_new_session=True,
        )
        self._processes[name] = process
        self.there.add(name)
        threading.Thread(target=self._hear, args=(name, process), daemon=True).start()

    def _hear(self, name: str, process: "subprocess.Popen[bytes]") -> None:
        """Pass on what a driver reports, and that it has ended."""
        over = False
        with _pipe(process.stdout) as stdout:
            for line in stdout:
                report = _report(name, line)
                over |= report.kind == OVER
                self._reports.put(report)
        status = process.wait()
        word = ""
        if not over:
            status, word = self._lost(name, status)
        self._reports.put(Report(name, GONE, word, status=status))

    def _lost(self, name: str, status: int) -> tuple[int, str]:
        """Status and word of a robot whose driver was killed, or has crashed."""
        leave_to_last_resort(self._orders[name].port)
        return RUNAWAY, (
            f"error: its process ended with status {status}, and its guardian told "
            f"it to stop. {LOOK}"
        )

    def report(self, seconds: float) -> Report | None:
        """The next report, or None if none comes within a number of seconds."""
        try:
            report = self._reports.get(timeout=seconds)
        except queue.Empty:
            return None
        if report.kind == GONE:
            self.there.discard(report.name)
        return report

    def go(self) -> None:
        """Let all robots drive."""
        for process in self._processes.values():
            # a driver that has ended has reported it
            with contextlib.suppress(OSError):
                stdin = _pipe(process.stdin)
                stdin.write(GO)
                stdin.flush()

    def stop(self) -> None:
        """Stop all robots, at once."""
        for process in self._processes.values():
            with contextlib.suppress(OSError):
                _pipe(process.stdin).close()

    def await_end(self, hear: Callable[[Report], None]) -> None:
        """Wait until all drivers, which were told to stop, have ended.

        Args:
            hear: called with their last reports.
        """
        deadline = time.monotonic() + END_TIME_MAX
        killed = False
        while self.there:
            left = deadline - time.monotonic()
            if left <= 0 and not killed:
                killed, left = True, END_TIME_MAX
                deadline += END_TIME_MAX
                for name in self.there:
                    self._processes[name].kill()
            if left <= 0:
                return
            report = self.report(left)
            if report is not None:
                hear(report)


def _report(name: str, line: bytes) -> Report:
    """What a driver says; a line of somebody else in its process is a text."""
    text = line.decode(errors="replace").rstrip()
    try:
        return Report(name, **json.loads(text))
    except (ValueError, TypeError):
        return Report(name, SAID, text)


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe
