"""An emulated robot in a time of its own: hours in seconds, and always the same."""

from collections.abc import Callable

from epuck_mj.bridge.failures import LinkLost
from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.line.interfaces import POLL_TIME
from epuck_mj.errors import UserError

TICK = 0.001
"""Time goes by in steps of this [s]."""


class VirtualTime:
    """A clock that goes on when somebody waits, and takes the robot with it.

    Attributes:
        now: the time [s].
        said: what has reached the host and was not received yet.
        cuts: grows while the robot's port is not there.
    """

    def __init__(self) -> None:
        """Zero, and nothing goes on with it."""
        self.now = 0.0
        self.said = b""
        self.cuts = 0
        self._emulator: Emulator | None = None

    def clock(self) -> float:
        """The time [s]."""
        return self.now

    def sleep(self, duration: float) -> None:
        """Let so many seconds go by."""
        self._pass(duration, lambda: False)

    def receive(self, duration: float) -> bytes:
        """What reaches the host, at the latest after so many seconds."""
        self._pass(duration, lambda: bool(self.said))
        data, self.said = self.said, b""
        return data

    def carry(self, emulator: Emulator) -> None:
        """Take a robot along from now on."""
        self._emulator = emulator

    def send(self, data: bytes) -> None:
        """Let the robot hear something."""
        assert self._emulator is not None
        self.said += self._emulator.exchange(data, self.now)

    @property
    def connected(self) -> bool:
        """Whether the robot's port is there."""
        return self._emulator is not None and self._emulator.connected(self.now)

    def _pass(self, duration: float, done: Callable[[], bool]) -> None:
        end = self.now + duration
        while self.now < end and not done():
            self.now = min(self.now + TICK, end)
            self.send(b"")
            self.cuts += not self.connected


class VirtualPort:
    """Where a host meets a robot in virtual time; see `interfaces.Port`."""

    def __init__(self, time: VirtualTime) -> None:
        """Open it.

        Raises:
            UserError: while it is not there.
        """
        self._time = time
        if not time.connected:
            raise UserError("no port 'virtual'; available: none")
        time.said = b""
        self._cuts = time.cuts
        self._is_open = True

    def send(self, data: bytes) -> None:
        """See Port."""
        self._refuse_lost()
        self._time.send(data)

    def receive(self, timeout: float) -> bytes:
        """See Port."""
        self._refuse_lost()
        data = self._time.receive(min(timeout, POLL_TIME))
        self._refuse_lost()
        return data

    def close(self) -> None:
        """See Port."""
        self._is_open = False

    def _refuse_lost(self) -> None:
        # a port that returns is another one
        whole = self._time.connected and self._time.cuts == self._cuts
        if not self._is_open or not whole:
            self._is_open = False
            raise LinkLost("a robot at 'virtual'", "nobody")
