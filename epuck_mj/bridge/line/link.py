"""The link to a robot: requests out, replies in, on a port that may fail at any time.

One request is in flight at a time, and every wait ends at a time that the caller sets.
If the last request was not answered, the link is out of step. It then sends no request
before `protocol.RESYNC` has succeeded.
"""

import time
from collections.abc import Callable

from epuck_mj.bridge.failures import BridgeError, LinkLost, NoReply, RobotRestarted
from epuck_mj.bridge.language.parsing import Request, T
from epuck_mj.bridge.language.protocol import RESYNC, greets
from epuck_mj.bridge.line.interfaces import Port
from epuck_mj.bridge.line.losable_port import LosablePort
from epuck_mj.constants import NOISE_TIME_MAX
from epuck_mj.errors import UserError

REOPEN_PERIOD = 0.1
"""Time between two attempts to open a lost port [s]. Chosen."""

DROPPED_MAX = 1024
"""Number of dropped bytes that are kept: enough to see a banner."""


class Link:
    """A conversation with a robot on a serial line.

    Attributes:
        clock: returns the time [s].
        in_step: whether the last request was answered, and nothing else came.
    """

    def __init__(
        self,
        open_port: Callable[[], Port],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Open the port.

        Args:
            open_port: opens it, and again if it was lost.
            clock: returns the time [s].
            sleep: waits for a number of seconds.

        Raises:
            UserError: if the port cannot be opened.
        """
        self.clock = clock
        self._sleep = sleep
        self._port = LosablePort(open_port)
        self.in_step = False
        self._rest = b""
        self._unanswered = False

    @property
    def lost(self) -> bool:
        """Whether the port has to be opened again."""
        return self._port.lost

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def reopen(self, until: float) -> None:
        """Open the lost port again as soon as it exists.

        Args:
            until: when to give up, by the clock.

        Raises:
            LinkLost: if it does not come back.
        """
        self.close()
        self.in_step, self._rest, self._unanswered = False, b"", False
        while True:
            try:
                self._port.reopen(max(until - self.clock(), REOPEN_PERIOD))
                return
            except UserError as error:
                if self.clock() >= until:
                    raise LinkLost("the port to come back", str(error)) from None
            self._sleep(REOPEN_PERIOD)

    def ask(self, request: Request[T], until: float = float("inf")) -> T:
        """Send a request; its reply.

        Args:
            request: what to ask.
            until: when to give up, by the clock, if the request's own patience does
                not end before.

        Raises:
            BridgeError: if the reply does not come, or something else does; the link
                then is out of step.
            RobotRestarted: if the robot was reset.
            LinkLost: if the port was lost.
        """
        binary = request.out.endswith(b"\0")
        stale = self._rest + self._port.receive(0.0)
        # dropped bytes may hold half of a banner: `resync` looks at them again
        self._rest = stale
        if not self.in_step:
            raise BridgeError("host and robot in step", stale or "an open question")
        # until the reply is here, whatever happens, a signal included
        self.in_step = False
        if greets(stale):
            raise RobotRestarted(f"silence before {request.name}", stale)
        if stale and binary:
            raise BridgeError(f"silence before {request.name}", stale)
        return self._exchange(request, until)

    def order(self, request: Request[T], until: float) -> T:
        """Send a request in ASCII in any state of the link; return its reply.

        Args:
            request: what to ask.
            until: see `ask`.

        Raises:
            BridgeError: see `ask`.
        """
        self.flush()
        self.in_step = False
        return self._exchange(request, until)

    def _exchange(self, request: Request[T], until: float) -> T:
        """Send a request; its reply, with which the link is in step."""
        binary = request.out.endswith(b"\0")
        self._rest = b""
        parser = request.parser()
        deadline = min(self.clock() + request.patience, until)
        self._port.send(request.out)
        while (now := self.clock()) < deadline:
            data = self._port.receive(deadline - now)
            if not data:
                continue
            self._rest = (self._rest + data)[-DROPPED_MAX:]
            reply = parser.feed(data)
            if reply is not None:
                self._rest = parser.rest
                self.in_step = True
                return reply
            if binary:
                # bytes come without a pause: the rest of them was lost
                deadline = min(self.clock() + RESYNC.quiet, until)
        raise NoReply(f"a reply to {request.name} in time", self._rest or "nothing")

    def resync(self, until: float) -> bool:
        """Synchronise with the robot; requests that it had received are carried out.

        Args:
            until: when to give up, by the clock. Something that is no answer shortens
                that to NOISE_TIME_MAX: who talks, but not as an e-puck, is none.

        Returns:
            Whether the robot's banner came: it was reset.

        Raises:
            BridgeError: if no e-puck answers.
            LinkLost: if the port was lost.
        """
        restarted, came = False, b""
        while True:
            self.in_step = False
            noisy_until = min(until, self.clock() + NOISE_TIME_MAX)
            self._port.send(RESYNC.flush)
            dropped = self._rest + self.drain(noisy_until)
            self._rest = b""
            if dropped:
                until = noisy_until
            restarted |= greets(dropped)
            came = dropped or came
            if self.clock() >= until:
                raise NoReply("an e-puck that answers V", came or "nothing")
            self.in_step = True
            try:
                self.ask(RESYNC.barrier, until)
                # an older barrier's reply may have come for this one's
                late = self.drain(until) if self._unanswered else b""
                if not self._rest + late:
                    self._unanswered = False
                    return restarted
            except LinkLost:
                raise
            except RobotRestarted:
                restarted = True
            except BridgeError:
                self._unanswered = True

    def drain(self, until: float) -> bytes:
        """Drop bytes until none has come for a while, or until a time; the bytes.

        Raises:
            LinkLost: if the port was lost.
        """
        came = b""
        heard = self.clock()
        while (now := self.clock()) < min(heard + RESYNC.quiet, until):
            data = self._port.receive(heard + RESYNC.quiet - now)
            if data:
                came = (came + data)[-DROPPED_MAX:]
                heard = self.clock()
        return came

    def flush(self) -> None:
        """End any command that the robot waits to complete; ASCII has to follow.

        Raises:
            LinkLost: if the port was lost.
        """
        self._rest = b""
        self._port.receive(0.0)
        self._port.send(RESYNC.flush)
        self.in_step = True
