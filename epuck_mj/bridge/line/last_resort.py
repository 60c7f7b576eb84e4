"""Last resort: a process that goes on stopping a robot after its bridge gave up.

A bridge ends soon, whether or not its robot confirmed that it stopped. The link may
return when the bridge has ended: then this process stops the robot.
"""

import contextlib
import os
import sys
import time
from collections.abc import Callable

from epuck_mj.bridge.line.connect import connect
from epuck_mj.bridge.line.interfaces import Connection
from epuck_mj.bridge.line.link import REOPEN_PERIOD
from epuck_mj.constants import PURSUIT_TIME
from epuck_mj.errors import UserError


def leave_to_last_resort(port: str) -> None:
    """Start a process that goes on stopping a robot; not on Windows.

    Args:
        port: see `connect`; it is free.
    """
    if os.name != "posix":
        return
    command = [sys.executable, "-m", __spec__.name, port]
    nowhere = [
        (os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_RDWR, 0) for stream in range(3)
    ]
    with contextlib.suppress(OSError):
        # Ctrl-C on a terminal is not for it
        os.posix_spawn(
            sys.executable, command, os.environ, file_actions=nowhere, setpgroup=0
        )


def stop_at_last(
    connect: Callable[[], Connection],
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> bool:
    """Stop a robot, trying for a time; return whether it confirmed that it stopped.

    Args:
        connect: opens the way to it.
        clock: returns the time [s].
        sleep: waits for a number of seconds.
    """
    until = clock() + PURSUIT_TIME
    while clock() < until:
        try:
            connection = connect()
            try:
                connection.stop()
                return True
            finally:
                connection.close()
        except UserError:
            sleep(REOPEN_PERIOD)
    return False


if __name__ == "__main__":
    stop_at_last(lambda: connect(sys.argv[1]))
