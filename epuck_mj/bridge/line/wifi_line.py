"""An e-puck2 on WiFi: commands go out, packets stream in, none are acknowledged.

The current reading is in the first packet that comes after it is asked for; earlier
packets are dropped. Whether the robot has stopped is seen from its step counters.
"""

import time
from collections.abc import Callable

from epuck_mj.bridge.failures import BridgeError, LinkLost, NoReply, StillMoving
from epuck_mj.bridge.language.packets import PacketParser, wifi_command
from epuck_mj.bridge.language.replies import Cycle, Sensors, Steps
from epuck_mj.bridge.line.interfaces import Greeting, Port
from epuck_mj.bridge.line.losable_port import LosablePort
from epuck_mj.constants import (
    CALIBRATION_TIME_MAX,
    CONNECT_TIME_MAX,
    NOISE_TIME_MAX,
    STOP_REPLY_TIME,
    STOP_TIME_MAX,
    WIFI_PERIOD,
)
from epuck_mj.errors import UserError

STANDING_TIME = 0.1
"""Time without a change of counters after which a robot is at rest [s]. Chosen.

A wheel slower than 10 steps/s, 1.3 mm/s, is not noticed.
"""


class WifiLine:
    """A connection to an e-puck2 over WiFi.

    Attributes:
        n_repairs: none: TCP loses no byte, and what is no packet ends the drive.
    """

    n_repairs = 0

    def __init__(
        self,
        open_port: Callable[[], Port],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Connect.

        Args:
            open_port: connects, and again if the connection was lost.
            clock: returns the time [s].
            sleep: waits for a number of seconds.

        Raises:
            UserError: if there is no robot.
        """
        self._clock = clock
        self._sleep = sleep
        self._port = LosablePort(open_port)
        self._parser = PacketParser()

    def greet(self) -> Greeting:
        """See Connection."""
        self._port.send(wifi_command(0, 0))
        sensors = self._next(self._clock() + CONNECT_TIME_MAX)
        self.stop()
        return Greeting(
            f"e-puck2 over WiFi, selector at {sensors.selector}", "not told over WiFi"
        )

    def cycle(self, left: int, right: int, changed: bool, until: float) -> Cycle:
        """See Connection.

        Raises:
            BridgeError: if what comes is no packet, or nothing comes.
            LinkLost: if the connection was lost.
        """
        if changed:
            self._port.send(wifi_command(left, right))
        self._drop(until)
        sensors = self._next(until)
        return Cycle(sensors.proximity, sensors.steps)

    def calibrate(self) -> None:
        """See Connection; always waits the whole time, as the end is not reported."""
        self._port.send(wifi_command(0, 0, calibrate=True))
        self._port.send(wifi_command(0, 0))
        end = self._clock() + CALIBRATION_TIME_MAX
        while self._clock() < end:
            self._next(end + WIFI_PERIOD + STOP_REPLY_TIME)

    def stop(self) -> None:
        """See Connection."""
        until = self._clock() + STOP_TIME_MAX
        problem: BridgeError = NoReply("counters at rest", "nothing")
        while self._clock() < until:
            try:
                if self._port.lost:
                    self._port.reopen(until - self._clock())
                    self._parser = PacketParser()
                if self._rests(until):
                    return
                problem = NoReply("step counters at rest", "others all the time")
            except UserError as error:
                self.close()
                problem = LinkLost("step counters at rest", str(error))
                self._sleep(STANDING_TIME)
        raise StillMoving("the robot to stand still", f"none: {problem}")

    def close(self) -> None:
        """See Connection."""
        self._port.close()

    def _rests(self, until: float) -> bool:
        """Whether the robot stands still after it was told to, seen in time."""
        self._port.send(wifi_command(0, 0))
        self._drop(until)
        # commands wait for their turn: what it does now says nothing yet
        self._next(min(self._clock() + STOP_REPLY_TIME, until))
        began = self._clock()
        first: Steps | None = None
        while self._clock() < began + STANDING_TIME:
            steps = self._next(min(self._clock() + STOP_REPLY_TIME, until)).steps
            if first is not None and steps != first:
                return False
            first = steps
        return True

    def _drop(self, until: float) -> None:
        """Drop the packets that have come, but keep incomplete ones.

        Raises:
            BridgeError: if there are still more of them in the end.
        """
        while data := self._port.receive(0.0):
            self._parser.feed(data)
            if self._clock() >= until:
                raise NoReply("the latest packet in time", "older ones without an end")

    def _next(self, until: float) -> Sensors:
        """Wait for packets; the latest of them.

        Raises:
            BridgeError: if none comes, or only others for NOISE_TIME_MAX.
        """
        came = b""
        while (now := self._clock()) < until:
            data = self._port.receive(until - now)
            if data and not came:
                until = min(until, now + NOISE_TIME_MAX)
            came = data or came
            found = self._parser.feed(data)
            if found:
                return found[-1]
        raise NoReply("a packet of an e-puck2 in time", came or "nothing")
