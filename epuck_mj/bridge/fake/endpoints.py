"""Endpoints of an emulated robot: a pseudo-terminal or a TCP port, in real time.

Both serve one host at a time, on this computer only. A scenario can make them vanish
and return.
"""

import contextlib
import os
import select
import socket
import time
from collections.abc import Callable
from pathlib import Path

from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.line.connect import SOCKET_SCHEME
from epuck_mj.errors import UserError

LOCALHOST = "127.0.0.1"

IDLE_TIME, BUSY_TIME = 0.004, 0.0005
"""Sleep between exchanges when no bytes, or some, are under way [s]."""

HEARD_MAX = 4096
"""Largest number of bytes received at once."""


class Pty:
    """A pseudo-terminal with a name that stays the same.

    Attributes:
        is_open: whether a host can open it.
    """

    def __init__(self, link: Path) -> None:
        """Appear.

        Args:
            link: its name, a symbolic link.

        Raises:
            UserError: if that cannot be made.
        """
        self._link = link
        self.is_open = False
        try:
            self.open()
        except OSError as error:
            raise UserError(f"cannot make '{link}': {error.strerror}") from None

    @property
    def name(self) -> str:
        """Name by which a host opens it."""
        return str(self._link)

    def open(self) -> None:
        """Make the robot's port appear."""
        try:
            # not on Windows
            import tty
        except ImportError:
            raise UserError(
                "this system has no pseudo-terminals: use --tcp PORT"
            ) from None
        self._master, self._slave = os.openpty()
        # nothing is echoed or changed, even before a host says so
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.is_open = True
        try:
            self._link.symlink_to(os.ttyname(self._slave))
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Make the robot's port disappear."""
        if not self.is_open:
            return
        self.is_open = False
        if self._link.is_symlink():
            self._link.unlink()
        os.close(self._master)
        os.close(self._slave)

    def handles(self) -> list[int]:
        """File descriptors that bytes may arrive on."""
        return [self._master] if self.is_open else []

    def receive(self) -> bytes:
        """The bytes that have arrived; does not wait."""
        with contextlib.suppress(BlockingIOError):
            return os.read(self._master, HEARD_MAX)
        return b""

    def send(self, data: bytes) -> None:
        """Send what the host accepts; the rest is lost, all if it is not connected."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)


class Tcp:
    """A TCP port on this computer, with the interface of Pty."""

    def __init__(self, port: int, scheme: str = SOCKET_SCHEME) -> None:
        """Appear.

        Args:
            port: its number; 0 takes any that is free.
            scheme: what the bridge's name of it begins with.

        Raises:
            UserError: if another program has it.
        """
        self._port = port
        self._scheme = scheme
        self._host: socket.socket | None = None
        self.is_open = False
        try:
            self.open()
        except OverflowError:
            raise UserError(
                f"cannot listen on port {port}: expected one from 0 to 65535"
            ) from None
        except OSError as error:
            raise UserError(f"cannot listen on port {port}: {error}") from None

    @property
    def name(self) -> str:
        """See Pty."""
        return f"{self._scheme}{LOCALHOST}:{self._port}"

    def open(self) -> None:
        """See Pty."""
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._server.bind((LOCALHOST, self._port))
            self._server.listen(1)
        except BaseException:
            self._server.close()
            raise
        self._server.setblocking(False)
        # the same again after it vanished
        self._port = self._server.getsockname()[1]
        self.is_open = True

    def close(self) -> None:
        """See Pty."""
        if not self.is_open:
            return
        self.is_open = False
        # first: who notices the loss and connects again at once is refused
        self._server.close()
        self._drop()

    def handles(self) -> list[int]:
        """See Pty."""
        if not self.is_open:
            return []
        # other connections wait in the queue until this one is closed
        return [(self._host or self._server).fileno()]

    def receive(self) -> bytes:
        """See Pty."""
        if self._host is None:
            with contextlib.suppress(BlockingIOError):
                self._host, _ = self._server.accept()
                self._host.setblocking(False)
                self._host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._host.recv(HEARD_MAX)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop()
        return data

    def send(self, data: bytes) -> None:
        """See Pty."""
        if self._host is None:
            return
        try:
            self._host.send(data)
        except BlockingIOError:
            pass
        except OSError:
            self._drop()

    def _drop(self) -> None:
        if self._host is not None:
            self._host.close()
            self._host = None


def serve(
    emulator: Emulator,
    endpoint: Pty | Tcp,
    clock: Callable[[], float],
    wanted: Callable[[], bool],
) -> None:
    """Run a robot behind an endpoint, and close the endpoint in the end.

    Args:
        emulator: the robot.
        endpoint: open.
        clock: the robot's time [s].
        wanted: asked all the time whether to go on.
    """
    try:
        while wanted():
            pause = BUSY_TIME if emulator.busy else IDLE_TIME
            ready = []
            if handles := endpoint.handles():
                ready = select.select(handles, [], [], pause)[0]
            else:
                # Windows refuses to select among nothing
                time.sleep(pause)
            heard = endpoint.receive() if ready else b""
            now = clock()
            said = emulator.exchange(heard, now)
            if said and endpoint.is_open:
                endpoint.send(said)
            connected = emulator.connected(now)
            if connected and not endpoint.is_open:
                endpoint.open()
            elif not connected and endpoint.is_open:
                endpoint.close()
    finally:
        endpoint.close()
