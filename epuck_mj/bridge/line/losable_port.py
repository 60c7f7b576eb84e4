"""Ports that may be lost at any time and opened again, with a limit to every wait."""

import contextlib
from collections.abc import Callable

from epuck_mj.bridge.failures import LinkLost
from epuck_mj.bridge.line.in_time import in_time
from epuck_mj.bridge.line.interfaces import Port
from epuck_mj.constants import CONNECT_TIME_MAX
from epuck_mj.errors import UserError

CLOSE_TIME_MAX = 0.3
"""Time after which a port that does not close is left to the system [s]. Chosen."""


class LosablePort:
    """A port that is closed as soon as it is lost; see `interfaces.Port`."""

    def __init__(self, open_port: Callable[[], Port]) -> None:
        """Open the port by `open_port`, which `reopen` calls again.

        Raises:
            UserError: if that is not possible, or not in CONNECT_TIME_MAX.
        """
        self._open_port = open_port
        self._port: Port | None = None
        self.reopen(CONNECT_TIME_MAX)

    @property
    def lost(self) -> bool:
        """Whether the port has to be opened again."""
        return self._port is None

    def reopen(self, seconds: float) -> None:
        """Close what is left of the lost port and open it again.

        Args:
            seconds: how long that may take.

        Raises:
            UserError: if that is not possible.
        """
        self.close()
        try:
            self._port = in_time(self._open_port, seconds, late=_close)
        except TimeoutError:
            raise UserError(
                f"the port did not open within {seconds:.1f} s. Is the robot switched "
                "on and near enough?"
            ) from None

    def send(self, data: bytes) -> None:
        """See Port."""
        try:
            self._opened().send(data)
        except LinkLost:
            self.close()
            raise

    def receive(self, timeout: float) -> bytes:
        """See Port."""
        try:
            return self._opened().receive(timeout)
        except LinkLost:
            self.close()
            raise

    def close(self) -> None:
        """See Port; a close that takes too long goes on in the background."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(TimeoutError):
                in_time(port.close, CLOSE_TIME_MAX)

    def _opened(self) -> Port:
        if self._port is None:
            raise LinkLost("an open port", "one that was lost")
        return self._port


def _close(port: Port) -> None:
    port.close()
