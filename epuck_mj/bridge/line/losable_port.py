"""Ports that may be lost at any time and opened again."""

from collections.abc import Callable

from epuck_mj.bridge.failures import LinkLost
from epuck_mj.bridge.line.interfaces import Port


class LosablePort:
    """A port that is closed as soon as it is lost; see `interfaces.Port`."""

    def __init__(self, open_port: Callable[[], Port]) -> None:
        """Open the port by `open_port`, which `reopen` calls again.

        Raises:
            UserError: if that is not possible.
        """
        self._open_port = open_port
        self._port: Port | None = open_port()

    @property
    def lost(self) -> bool:
        """Whether the port has to be opened again."""
        return self._port is None

    def reopen(self) -> None:
        """Close what is left of the lost port and open it again.

        Raises:
            UserError: if that is not possible.
        """
        self.close()
        self._port = self._open_port()

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
        """See Port."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def _opened(self) -> Port:
        if self._port is None:
            raise LinkLost("an open port", "one that was lost")
        return self._port
