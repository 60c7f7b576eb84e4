"""Driver: the process of one robot of a fleet.

The process gets an order on its command line. It greets the robot and waits, with the
robot standing, for GO on standard input. The end of standard input stops the drive at
any time: either the fleet wants that, or the fleet's process has ended. The driver
reports on standard output, one line of JSON for each event.
"""

import gc
import json
import os
import signal
import sys
import threading
from collections.abc import Sequence

from epuck_mj.bridge.drive.console import fleet_line, fleet_summary
from epuck_mj.bridge.drive.mission import Outcome, accomplish
from epuck_mj.bridge.drive.order import Order, mission
from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Step
from epuck_mj.bridge.failures import RUNAWAY
from epuck_mj.bridge.line.connect import connect
from epuck_mj.bridge.line.interfaces import Greeting
from epuck_mj.bridge.line.last_resort import leave_to_last_resort
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main
from epuck_mj.host.interruption import SIGNALS, Interruption, send
from epuck_mj.host.output import Output, OutputLost

MODULE = "epuck_mj.bridge.fleet.driver"

GO = b"go\n"
"""Message that a greeted robot may drive."""

REST_PERIOD = 0.5
"""Time between two readings of a robot that waits [s]. Chosen."""

MET, LINE, SAID, OVER = "met", "line", "said", "over"
"""Kinds of reports: it answers; how it drives; a text; it has ended."""


class Reporter:
    """Watcher that reports to the fleet, waits for its GO, and obeys its stop."""

    def __init__(self, output: Output) -> None:
        """Report nothing yet."""
        self._output = output
        self._go = threading.Event()

    def listen(self) -> None:
        """Wait for GO and for the end of standard input, which ends the drive."""
        try:
            while heard := os.read(0, len(GO)):
                if GO.startswith(heard):
                    self._go.set()
        finally:
            send(signal.SIGTERM)

    def report(self, kind: str, text: str, **more: object) -> None:
        """Tell the fleet something, if it still is there."""
        self._output.say(json.dumps({"kind": kind, "text": text, **more}))

    def say(self, text: str) -> None:
        """See Watcher."""
        self.report(SAID, text)

    def met(self, greeting: Greeting, robot: RealRobot) -> None:
        """See Watcher; waits until the robot may drive."""
        robot.rest()
        self.report(MET, f"{greeting.firmware}; battery {greeting.battery}")
        while not self._go.wait(REST_PERIOD):
            robot.rest()

    def saw(self, step: Step, robot: RealRobot) -> bool:
        """See Watcher; an end comes as a signal."""
        self.report(LINE, fleet_line(step, robot))
        return False


def drive(argv: Sequence[str]) -> int:
    """Drive a robot as ordered and return the exit status of the bridge."""
    # only the drive may end this process
    for signum in SIGNALS:
        signal.signal(signum, signal.SIG_IGN)
    order = Order.from_json(argv[0])
    with Output(sys.stdout) as output, Interruption() as interruption:
        reporter = Reporter(output)
        threading.Thread(target=reporter.listen, daemon=True).start()
        # no garbage collection of loaded modules
        gc.freeze()
        try:
            outcome = accomplish(
                mission(order), lambda: connect(order.port), reporter, interruption
            )
        except UserError as error:
            status, word, facts = 2, f"error: {error}", ""
        else:
            status, word, facts = outcome.status, outcome.word, _facts(outcome)
        try:
            reporter.report(OVER, word, facts=facts)
            output.finish()
        except OutputLost:
            # the fleet has ended; the robot already stands still
            pass
    if status == RUNAWAY:
        leave_to_last_resort(order.port)
    return status


def _facts(outcome: Outcome) -> str:
    """Summary of the drive, with what became of its log."""
    if outcome.robot is None or outcome.session.start is None:
        return ""
    facts = fleet_summary(outcome.session, outcome.robot)
    return f"{facts}; no log: {outcome.failure}" if outcome.failure else facts


if __name__ == "__main__":
    main(drive)
