"""Robots that go wrong on purpose, as data: what they say is a function of bytes.

Behind each one is a robot in order, whose wheels do what it hears. From a moment on the
peer says something else than that robot would. What counts is measured on its side: how
long after that moment its wheels are told to stand.
"""

import contextlib
import os
import select
import socket
import threading
import time
import tty
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from epuck_mj.bridge.fake.builds import BUILDS
from epuck_mj.bridge.fake.firmware import Firmware
from epuck_mj.bridge.fake.motors_and_sensors import Wheel
from epuck_mj.bridge.fake.wifi_firmware import WifiFirmware
from epuck_mj.bridge.language.binary import CYCLE
from epuck_mj.bridge.language.packets import SENSORS
from epuck_mj.bridge.language.parsing import BANNER

LINKS = ("pty", "tcp", "wifi")
"""A serial line on a pseudo-terminal, one on TCP, and packets of an e-puck2 on TCP."""

TICK = 0.002
"""Pause of a peer that has nothing to say [s]."""

BACKLOG_MAX = 65_536
"""Bytes that a peer keeps to say when the line takes no more."""

Wrong = Callable[[bytes, bytes, float], bytes]
"""What it says of what would be right, what it heard, and the time of the fault [s]."""


# what they say


def silence() -> Wrong:
    """Nothing."""
    return lambda right, heard, age: b""


def flood(text: bytes) -> Callable[[], Wrong]:
    """The same again and again, faster than anybody reads."""
    return lambda: lambda right, heard, age: text * (BACKLOG_MAX // len(text))


def babble() -> Wrong:
    """Random bytes, faster than anybody reads."""
    rng = np.random.default_rng(0)
    return lambda right, heard, age: rng.bytes(BACKLOG_MAX)


def paced(text: bytes, period: float) -> Callable[[], Wrong]:
    """A text at intervals [s], whatever it is told."""

    def make() -> Wrong:
        n_said = 0

        def say(right: bytes, heard: bytes, age: float) -> bytes:
            nonlocal n_said
            due = int(age / period) + 1 - n_said
            n_said += due
            return text * due

        return say

    return make


def late(delay: float) -> Callable[[], Wrong]:
    """Everything right, but too late [s]."""

    def make() -> Wrong:
        waiting: list[tuple[float, bytes]] = []

        def say(right: bytes, heard: bytes, age: float) -> bytes:
            waiting.append((age + delay, right))
            said = b""
            while waiting and waiting[0][0] <= age:
                said += waiting.pop(0)[1]
            return said

        return say

    return make


def trickle(period: float) -> Callable[[], Wrong]:
    """Everything right, but one byte at a time [s]."""

    def make() -> Wrong:
        waiting = bytearray()
        next_at = 0.0

        def say(right: bytes, heard: bytes, age: float) -> bytes:
            nonlocal next_at
            waiting.extend(right)
            if age < next_at or not waiting:
                return b""
            next_at = age + period
            return bytes([waiting.pop(0)])

        return say

    return make


def halves() -> Wrong:
    """The first half of everything."""
    return lambda right, heard, age: right[: len(right) // 2]


def doubles() -> Wrong:
    """Everything twice."""
    return lambda right, heard, age: right + right


def echo() -> Wrong:
    """What it hears."""
    return lambda right, heard, age: heard


def saturated() -> Wrong:
    """Everything right in length, of bytes that no reading has."""
    return lambda right, heard, age: right[:1] + b"\xff" * (len(right) - 1)


PACKET = bytes([SENSORS]) + bytes(104)
REPLY = CYCLE.pack(*[0] * 12)


@dataclass(frozen=True)
class Peer:
    """A way to go wrong.

    Attributes:
        wrong: makes what says it.
        links: where it can.
        reads: whether it takes what it is told from the line; else it only looks at it.
        hangs_up: whether it first ends the connection.
        returns: whether it can be connected to after that.
        floods: whether it says as much as it can.
    """

    wrong: Callable[[], Wrong]
    links: tuple[str, ...] = LINKS
    reads: bool = True
    hangs_up: bool = False
    returns: bool = True
    floods: bool = False


PEERS = {
    "silence": Peer(silence),
    "deaf": Peer(silence, ("tcp", "wifi"), reads=False),
    "flood of readings": Peer(flood(PACKET), ("wifi",), floods=True),
    "flood of empty packets": Peer(flood(b"\x03"), ("wifi",), floods=True),
    "flood of images": Peer(flood(b"\x01" + bytes(38_400)), ("wifi",), floods=True),
    "flood of replies": Peer(flood(REPLY), ("pty", "tcp"), floods=True),
    "flood of lines": Peer(flood(b"s\r\n"), ("pty", "tcp"), floods=True),
    "flood, deaf": Peer(flood(PACKET), ("tcp", "wifi"), reads=False, floods=True),
    "babble": Peer(babble, floods=True),
    "slow babble": Peer(paced(b"?", 0.03)),
    "endless banner": Peer(flood(b"\f\a" + BANNER + b"\r\n"), floods=True),
    "slow banner": Peer(paced(b"\f\a" + BANNER + b"\r\n", 0.1)),
    "late answers": Peer(late(0.45)),
    "half packets": Peer(halves),
    "trickle": Peer(trickle(0.04)),
    "doubles": Peer(doubles, ("pty", "tcp")),
    "echo": Peer(echo),
    "saturated": Peer(saturated),
    "hangs up": Peer(silence, hangs_up=True, returns=False),
    "hangs up, returns mute": Peer(silence, hangs_up=True),
    "hangs up, returns babbling": Peer(babble, hangs_up=True, floods=True),
    "hangs up, returns flooding": Peer(
        flood(PACKET), ("tcp", "wifi"), hangs_up=True, floods=True
    ),
}
"""Ways to go wrong, by name."""

CASES = [(name, link) for name, peer in PEERS.items() for link in peer.links]
"""Each peer on each of its links."""


# the robot in order behind them


@dataclass
class Body:
    """Wheels that turn exactly as told, on the peer's clock.

    Attributes:
        now: the time [s].
        told: when the wheels were told what [steps/s].
    """

    now: float = 0.0
    told: list[tuple[float, float, float]] = field(default_factory=list)

    def drive(self, left: Wheel, right: Wheel) -> None:
        """See Body."""
        self.told.append((self.now, left.rate, right.rate))

    def steps(self) -> tuple[int, int]:
        """See Body."""
        made = [0.0, 0.0]
        ends = [*(time for time, *_ in self.told[1:]), self.now]
        for (start, *rates), end in zip(self.told, ends, strict=False):
            made = [m + r * (end - start) for m, r in zip(made, rates, strict=True)]
        return round(made[0]), round(made[1])

    def proximity(self) -> np.ndarray:
        """See Body."""
        return np.zeros(8, int)

    ambient = proximity

    def selector(self) -> int:
        """See Body."""
        return 3

    def battery(self) -> float:
        """See Body."""
        return 3.7


class Hostile(threading.Thread):
    """A peer behind a port of its own, in a thread.

    Attributes:
        name_of_port: as `--port` takes it.
        fault: when it went wrong, by `time.monotonic`; None if it did not yet.
        lateness: longest time that the thread had to wait for its turn [s].
    """

    def __init__(self, peer: Peer, link: str, folder: Path, drives: float = 0.3):
        """Open the port.

        Args:
            peer: what it becomes.
            link: one of LINKS.
            folder: for a pseudo-terminal's name.
            drives: how long it drives until it goes wrong [s]; below 0 it is wrong from
                the first byte on.
        """
        super().__init__(daemon=True)
        self._peer, self._wrong, self._drives = peer, peer.wrong(), drives
        self._body = Body(time.monotonic())
        now = self._body.now
        self._robot = (
            WifiFirmware(self._body, now)
            if link == "wifi"
            else Firmware(self._body, BUILDS["epuck2"], now)
        )
        self._robot.output(now)
        self._end = threading.Event()
        self._backlog = b""
        self._n_seen = 0
        self.met: float | None = None
        self.fault: float | None = None
        self.lateness = 0.0
        self._line: socket.socket | _Master | None = None
        self._server: socket.socket | None = None
        if link == "pty":
            self._path = folder / f"puck-{id(self)}"
            self._line = _Master(self._path)
            self.name_of_port = str(self._path)
        else:
            self._listen(0)
            assert self._server is not None
            self._number = self._server.getsockname()[1]
            scheme = "tcp" if link == "wifi" else "socket"
            self.name_of_port = f"{scheme}://127.0.0.1:{self._number}"

    def __enter__(self) -> "Hostile":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self.join(10)
        assert not self.is_alive()

    @property
    def driving(self) -> bool:
        """Whether the wheels are told to turn."""
        return bool(self._body.told) and any(self._body.told[-1][1:])

    def stood(self) -> float | None:
        """When the wheels were last told to stand, for good; None if they drive."""
        if not self._body.told or self.driving:
            return None
        told = self._body.told
        last = max((n for n, row in enumerate(told) if any(row[1:])), default=-1)
        return told[last + 1][0]

    def run(self) -> None:
        """Live until the end of the `with` block."""
        try:
            while not self._end.is_set():
                began = time.monotonic()
                busy = self._tick(began)
                if not busy:
                    time.sleep(TICK)
                self.lateness = max(
                    self.lateness, time.monotonic() - began - (0 if busy else TICK)
                )
        finally:
            for end in (self._line, self._server):
                if end is not None:
                    end.close()

    def _listen(self, number: int) -> None:
        self._server = socket.create_server(("127.0.0.1", number))
        self._server.setblocking(False)

    def _tick(self, now: float) -> bool:
        """Hear and say something; whether there is more to say."""
        if self._line is None and not self._accept():
            return False
        heard = self._hear()
        if heard and self.met is None:
            self.met = now
        self._body.now = now
        self._robot.feed(heard, now)
        right = self._robot.output(now)
        self._go_wrong(now)
        if self.fault is None:
            said = right
        elif len(self._backlog) < BACKLOG_MAX and self._line is not None:
            said = self._wrong(right, heard, now - self.fault)
        else:
            said = b""
        self._backlog += said
        self._say()
        return bool(self._backlog)

    def _accept(self) -> bool:
        if self._server is None:
            return False
        try:
            self._line, _ = self._server.accept()
        except BlockingIOError:
            return False
        self._line.setblocking(False)
        self._n_seen = 0
        return True

    def _go_wrong(self, now: float) -> None:
        """Become wrong, if it is time to."""
        if self.fault is not None or self.met is None:
            return
        began = next((t for t, *rates in self._body.told if any(rates)), None)
        if self._drives >= 0 and (began is None or now < began + self._drives):
            return
        self.fault = now
        if self._peer.hangs_up and self._line is not None:
            # whether new hosts are taken is decided before the old one knows
            if self._server is not None and not self._peer.returns:
                self._server.close()
                self._server = None
            self._line.close()
            self._line = None
            self._backlog = b""
            if self._server is None and self._peer.returns:
                self._line = _Master(self._path)

    def _hear(self) -> bytes:
        assert self._line is not None
        try:
            if self.fault is None or self._peer.reads:
                return self._line.recv(4096)
            assert isinstance(self._line, socket.socket)
            heard = self._line.recv(BACKLOG_MAX, socket.MSG_PEEK)[self._n_seen :]
            self._n_seen += len(heard)
            return heard
        except BlockingIOError:
            return b""
        except OSError:
            # of a pseudo-terminal that nobody has open, or a host that has gone
            return b""

    def _say(self) -> None:
        if not self._backlog or self._line is None:
            return
        try:
            n_sent = self._line.send(self._backlog)
            self._backlog = self._backlog[n_sent:]
        except BlockingIOError:
            # let the reader have its turn
            with contextlib.suppress(OSError, ValueError):
                select.select([], [self._line], [], TICK)
        except OSError:
            self._backlog = b""
            if isinstance(self._line, socket.socket):
                # the host has gone: the next may come
                self._line.close()
                self._line = None


class _Master:
    """The peer's end of a pseudo-terminal, as a socket."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        path.symlink_to(os.ttyname(self._slave))

    def fileno(self) -> int:
        return self._master

    def recv(self, n_bytes: int) -> bytes:
        return os.read(self._master, n_bytes)

    def send(self, data: bytes) -> int:
        return os.write(self._master, data)

    def close(self) -> None:
        self._path.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)
