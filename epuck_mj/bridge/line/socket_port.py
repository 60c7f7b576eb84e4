"""Ports that are TCP connections."""

import contextlib
import socket

from epuck_mj.bridge.failures import LinkLost
from epuck_mj.bridge.line import guardian
from epuck_mj.bridge.line.interfaces import POLL_TIME, READ_MAX, WRITE_TIME_MAX
from epuck_mj.constants import CONNECT_TIME_MAX
from epuck_mj.errors import UserError


class SocketPort:
    """A TCP connection; see `interfaces.Port`."""

    def __init__(
        self, name: str, host: str, number: int, farewell: bytes = b""
    ) -> None:
        """Connect.

        Args:
            name: of the port, for a person.
            host: name or address.
            number: of its TCP port.
            farewell: see SerialPort.

        Raises:
            UserError: if that is not possible; says why.
        """
        self.name = name
        try:
            self._socket = socket.create_connection((host, number), CONNECT_TIME_MAX)
        except (OSError, ValueError) as error:
            # ValueError: no name that a host can have
            reason = getattr(error, "strerror", None) or error
            raise UserError(
                f"cannot open port '{name}': {reason}. Is the robot on, and in this "
                "computer's network?"
            ) from None
        self._guardian = None
        try:
            # else a stop waits until what was sent before it is confirmed
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._guardian = guardian.hire(self._socket.fileno, farewell)
        except OSError as error:
            self.close()
            raise UserError(guardian.missing(name, error)) from None

    def send(self, data: bytes) -> None:
        """See Port."""
        try:
            self._socket.settimeout(WRITE_TIME_MAX)
            self._socket.sendall(data)
        except OSError as error:
            raise LinkLost(f"a robot at '{self.name}'", f"'{error}'") from None

    def receive(self, timeout: float) -> bytes:
        """See Port; a wait is at most POLL_TIME long, whatever the timeout."""
        try:
            self._socket.settimeout(min(max(timeout, 0.0), POLL_TIME))
            data = self._socket.recv(READ_MAX)
        except (TimeoutError, BlockingIOError):
            return b""
        except OSError as error:
            raise LinkLost(f"a robot at '{self.name}'", f"'{error}'") from None
        if not data:
            raise LinkLost(f"a robot at '{self.name}'", "'disconnected'")
        return data

    def close(self) -> None:
        """See Port."""
        guardian.dismiss(self._guardian)
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
