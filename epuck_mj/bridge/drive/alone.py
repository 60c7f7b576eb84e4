"""A drive of one robot on this terminal: a status line, stop keys, a summary."""

import contextlib
import sys
from collections.abc import Callable

from epuck_mj.bridge.drive.console import (
    HEADING,
    QUIET_PERIOD,
    drive_summary,
    live_line,
)
from epuck_mj.bridge.drive.keyboard import Keyboard, keyboard
from epuck_mj.bridge.drive.log import Show, show_log
from epuck_mj.bridge.drive.mission import Mission, accomplish
from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Step
from epuck_mj.bridge.line.interfaces import Connection, Greeting
from epuck_mj.host.interruption import Interruption
from epuck_mj.host.output import Output, OutputLost, complain


def drive_alone(
    mission: Mission,
    connect: Callable[[], Connection],
    show: Show,
) -> int:
    """Drive, stop, write the log, and return the exit status.

    Args:
        mission: what to do.
        connect: opens the way to the robot.
        show: writes the log's pictures, when the robot stands.

    Raises:
        UserError: if it never began, or its log could not be written.
    """
    with (
        Output(sys.stdout) as output,
        Interruption() as interruption,
        keyboard() as keys,
    ):
        terminal = Terminal(mission, output, keys)
        try:
            outcome = accomplish(mission, connect, terminal, interruption)
        finally:
            terminal.end_line()
        # tell the user before the pictures, which take time; stdout may be lost
        if outcome.status:
            complain(outcome.word)
        else:
            with contextlib.suppress(OutputLost):
                output.say(outcome.word)
        facts, failure = "", outcome.failure
        if outcome.robot is not None and outcome.session.start is not None:
            facts = drive_summary(outcome.session, outcome.robot)
            files, unshown = show_log(mission.log, outcome.trajectory, show, facts)
            failure = failure or unshown
            named = f"\nlog            {', '.join(map(str, files))}" if files else ""
            facts = f"{facts}{named}"
        try:
            if facts:
                output.say(facts)
            output.finish()
        except OutputLost:
            if not outcome.status:
                raise
    if failure is not None and not outcome.status:
        raise failure
    if failure is not None:
        complain(f"error: {failure}")
    return outcome.status


class Terminal:
    """Watcher of a robot that drives alone, on a terminal or a pipe."""

    def __init__(self, mission: Mission, output: Output, keys: Keyboard) -> None:
        """Say nothing yet."""
        self._mission = mission
        self._output = output
        self._keys = keys
        self._live = sys.stdout.isatty()
        self._in_line = False
        quiet = max(1, round(QUIET_PERIOD / mission.task.control_step))
        self._every = 1 if self._live else quiet

    def say(self, text: str) -> None:
        """See Watcher."""
        self._output.say(text)

    def met(self, greeting: Greeting, robot: RealRobot) -> None:
        """See Watcher."""
        dry = "DRY RUN, it stands still. " if self._mission.dry_run else ""
        stops = "q or space stops. " if self._keys.there else ""
        self.say(f"{greeting.firmware}; battery {greeting.battery}")
        self.say(f"{dry}{stops}Ctrl-C stops.\n{HEADING}")

    def saw(self, step: Step, robot: RealRobot) -> bool:
        """See Watcher."""
        if step.number % self._every == 0:
            self._in_line = self._live
            start, end = ("\r", "") if self._live else ("", "\n")
            self._output.say(f"{start}{live_line(step, robot)}", end)
        return self._keys.stop_wanted()

    def end_line(self) -> None:
        """End the status line that is rewritten."""
        if self._in_line:
            with contextlib.suppress(OutputLost):
                self._output.say("")
