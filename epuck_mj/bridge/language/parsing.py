"""Requests, and the parsers that find their replies in the bytes that come.

A request is data: bytes to send, a fresh parser for the reply, and how long the reply
may take. A parser is fed as bytes come in, in pieces of any size; it returns the reply,
or None while it needs more, or raises. It never waits: deadlines are the link's.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from epuck_mj.bridge.failures import BridgeError, RobotRestarted
from epuck_mj.constants import REPLY_TIME_MAX

T = TypeVar("T")

BANNER = b"WELCOME to the SerCom protocol on e-Puck"
"""Text that a robot sends after a reset only.

Source: e-puck-library, `Asercom.c`, `BTcom.c`.
"""

NOT_FOUND = b"z,Command not found"
"""Text that a robot sends for a command it does not understand.

Source: e-puck-library, `Asercom.c`, `BTcom.c`.
"""

LINE_MAX = 256
"""Longest line [bytes]: every reply is shorter."""


@dataclass(frozen=True)
class Request(Generic[T]):
    """A request to the robot, which can keep only one at a time.

    Attributes:
        name: what it is, for a person.
        out: bytes to send.
        parser: makes the parser of its reply.
        patience: time after which no reply will come any more [s].
    """

    name: str
    out: bytes
    parser: Callable[[], "LinesParser[T] | BytesParser[T]"]
    patience: float = REPLY_TIME_MAX


@dataclass(frozen=True)
class Line:
    r"""One line of a reply.

    Attributes:
        pattern: found in such a line, whose `\r` is still there and `\n` is not.
        damaged: how a line begins that was meant to be one; None if a line of another
            reply may begin so.
        what: what it is, for a person.
    """

    pattern: re.Pattern[bytes]
    damaged: bytes | None
    what: str


class LinesParser(Generic[T]):
    """Parser of one ASCII reply of given lines in a given order.

    Any other line is not ours and is skipped: garbage, banners' second halves, replies
    to what was given up. A line that begins as ours and is wrong raises.
    """

    def __init__(
        self, lines: tuple[Line, ...], reply: Callable[[list[bytes]], T]
    ) -> None:
        """Expect these lines and make a reply of them.

        Args:
            lines: in the order in which they come.
            reply: from every line between the first and the last, these included.
        """
        self._awaited = list(lines)
        self._reply = reply
        self._heard: list[bytes] = []
        self._buffer = b""

    @property
    def rest(self) -> bytes:
        """Bytes that came after the reply's last line."""
        return self._buffer if not self._awaited else b""

    def feed(self, data: bytes) -> T | None:
        """Add bytes; the reply once it is complete, else None.

        Args:
            data: what came, any number of bytes.

        Raises:
            BridgeError: if this cannot be the reply any more, or was complete before.
            RobotRestarted: if the robot's banner came instead.
        """
        if not self._awaited:
            raise BridgeError("nothing after the reply", data)
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        for number, line in enumerate(lines):
            self._take(line)
            if not self._awaited:
                self._buffer = b"\n".join([*lines[number + 1 :], self._buffer])
                return self._reply(self._heard)
        self._refuse_long(self._buffer)
        return None

    def _take(self, line: bytes) -> None:
        awaited = self._awaited[0]
        self._refuse_long(line)
        if BANNER in line:
            raise RobotRestarted(awaited.what, line)
        if line.endswith(NOT_FOUND + b"\r"):
            raise BridgeError(awaited.what, line)
        if awaited.pattern.search(line):
            self._awaited.pop(0)
            self._heard.append(line)
        elif awaited.damaged is not None and line.startswith(awaited.damaged):
            raise BridgeError(awaited.what, line)
        elif self._heard:
            self._heard.append(line)

    def _refuse_long(self, line: bytes) -> None:
        if len(line) > LINE_MAX:
            what = self._awaited[0].what
            raise BridgeError(f"{what}, in a line of at most {LINE_MAX} bytes", line)


class BytesParser(Generic[T]):
    """Parser of one binary reply with a fixed number of bytes.

    The bytes bear no mark. The caller makes sure that no other reply is under way.
    """

    def __init__(self, what: str, length: int, reply: Callable[[bytes], T]) -> None:
        """Expect a number of bytes and make a reply of them.

        Args:
            what: the reply, for a person.
            length: in bytes.
            reply: raises BridgeError if these bytes cannot be one.
        """
        self._what = f"{what}, {length} bytes"
        self._length = length
        self._reply = reply
        self._buffer = b""
        self._done = False

    @property
    def rest(self) -> bytes:
        """Always empty: bytes after the reply raise."""
        return b""

    def feed(self, data: bytes) -> T | None:
        """See LinesParser."""
        if self._done:
            raise BridgeError("nothing after the reply", data)
        self._buffer += data
        if BANNER[:8] in self._buffer:
            raise RobotRestarted(self._what, self._buffer)
        if len(self._buffer) < self._length:
            return None
        if len(self._buffer) > self._length:
            raise BridgeError(self._what, self._buffer)
        self._done = True
        return self._reply(self._buffer)
