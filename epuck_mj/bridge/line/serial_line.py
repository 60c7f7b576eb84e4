"""A robot on a serial line: e-puck v1 over Bluetooth, e-puck2 over Bluetooth or USB."""

from epuck_mj.bridge.failures import BridgeError, LinkLost, RobotRestarted, StillMoving
from epuck_mj.bridge.language import ascii, binary
from epuck_mj.bridge.language.replies import Cycle
from epuck_mj.bridge.line.interfaces import Greeting
from epuck_mj.bridge.line.link import Link
from epuck_mj.constants import CONNECT_TIME_MAX, STOP_REPLY_TIME, STOP_TIME_MAX


class SerialLine:
    """A connection over a serial line.

    Attributes:
        n_repairs: how often a resynchronisation was needed.
    """

    def __init__(self, link: Link) -> None:
        """Use an open link."""
        self._link = link
        self.n_repairs = 0

    def greet(self) -> Greeting:
        """See Connection."""
        until = self._link.clock() + CONNECT_TIME_MAX
        # the robot may still be driving: stop it first
        try:
            self._link.order(ascii.stop_order(), self._link.clock() + STOP_REPLY_TIME)
        except LinkLost:
            raise
        except BridgeError:
            # an incomplete command of an earlier connection
            pass
        self._link.resync(until)
        self._link.ask(ascii.stop_order(), until)
        version = self._link.ask(ascii.version_query(), until)
        try:
            battery = str(self._link.ask(ascii.battery_query(), until))
        except LinkLost:
            raise
        except BridgeError:
            # the others toggle an LED, or do not understand
            self._link.resync(until)
            battery = "unknown to this firmware"
        # what S leaves as it was: the speeds that every cycle is checked with
        self.cycle(0, 0, changed=True, until=until)
        return Greeting(", ".join(version.lines), battery)

    def cycle(self, left: int, right: int, changed: bool, until: float) -> Cycle:
        """See Connection; synchronises again if host and robot are out of step.

        Raises:
            BridgeError: if that fails; names what was wrong first.
            RobotRestarted: if the robot was reset.
            LinkLost: if the port was lost.
        """
        first: BridgeError | None = None
        while True:
            try:
                if not self._link.in_step:
                    self.n_repairs += 1
                    if self._link.resync(until):
                        raise RobotRestarted("a robot that goes on", "its banner")
                    # it is unknown whether the last speeds arrived
                    changed = True
                return self._link.ask(
                    binary.echoed_cycle_packet(left, right, changed), until
                )
            except (LinkLost, RobotRestarted):
                raise
            except BridgeError as error:
                first = first or error
                if self._link.clock() >= until:
                    raise first from None

    def calibrate(self) -> None:
        """See Connection."""
        self._link.ask(ascii.calibration_order())

    def stop(self) -> None:
        """See Connection."""
        until = again = self._link.clock() + STOP_TIME_MAX
        problem: BridgeError | None = None
        while problem is None or self._link.clock() < until:
            try:
                if self._link.lost:
                    self._link.reopen(until)
                elif problem is not None:
                    # a robot that sends all the time gets commands with pauses
                    self._link.drain(again)
                again = min(self._link.clock() + STOP_REPLY_TIME, until)
                # at once, instead of waiting for silence as a resync does
                self._link.order(ascii.stop_order(), again)
                return
            except BridgeError as error:
                problem = error
        raise StillMoving("the robot to say that it stopped", f"none: {problem}")

    def close(self) -> None:
        """See Connection."""
        self._link.close()
