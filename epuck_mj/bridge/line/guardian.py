"""Guardian: a process that stops the robot if the bridge is killed.

It shares the bridge's open port and waits until the pipe from the bridge ends. If a
byte came before that, the bridge has ended in order. If not, the bridge was killed or
has crashed, and the guardian sends the stop message several times.

It is run by its path and uses only the standard library, to start at once.
"""

import contextlib
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

N_FAREWELLS, FAREWELL_PERIOD = 5, 0.2
"""Number of stop messages and the time between two [s]: bytes may be lost."""

DISMISSED = b"."
"""Message of a bridge that needs no guardian any more."""

DISMISSAL_TIME_MAX = 0.2
"""Time after which a dismissed guardian is killed [s]. Chosen."""


def hire(fileno: Callable[[], int], farewell: bytes) -> subprocess.Popen | None:
    """Start a guardian; None without a stop message or a descriptor to share.

    There is no guardian on Windows, nor for ports that are no files.

    Args:
        fileno: gives the file descriptor of the robot's port.
        farewell: bytes that stop the robot, whatever it heard before.
    """
    if not farewell or os.name != "posix":
        return None
    try:
        port = fileno()
    except io.UnsupportedOperation:
        return None
    return subprocess.Popen(
        [sys.executable, "-I", "-S", __file__, str(port), farewell.hex()],
        stdin=subprocess.PIPE,
        # a reader of the bridge's output does not have to wait for the guardian's end
        stdout=subprocess.DEVNULL,
        pass_fds=[port],
        # Ctrl-C on a terminal is for the bridge
        start_new_session=True,
    )


def missing(port: str, error: OSError) -> str:
    """Message for a person: without a guardian, a port is not used."""
    return (
        f"no guardian for '{port}', which would stop the robot if this program were "
        f"killed, so the port was not used: {error}. Close other programs and try again"
    )


def dismiss(process: subprocess.Popen | None) -> None:
    """End a guardian, which closes the port."""
    if process is None or process.returncode is not None:
        return
    try:
        process.communicate(DISMISSED, timeout=DISMISSAL_TIME_MAX)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


def guard(pipe: int, port: int, farewell: bytes) -> bool:
    """Wait for the bridge's end and, if it was killed, stop the robot; whether it was.

    Args:
        pipe: file descriptor that ends with the bridge.
        port: file descriptor of the robot's port.
        farewell: bytes that stop the robot, whatever it heard before.
    """
    if os.read(pipe, len(DISMISSED)) == DISMISSED:
        return False
    for _ in range(N_FAREWELLS):
        # the robot may be reachable again a little later
        with contextlib.suppress(OSError):
            os.write(port, farewell)
        time.sleep(FAREWELL_PERIOD)
    return True


if __name__ == "__main__":
    # a signal that ends the bridge must not end its guardian
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    guard(0, int(sys.argv[1]), bytes.fromhex(sys.argv[2]))
