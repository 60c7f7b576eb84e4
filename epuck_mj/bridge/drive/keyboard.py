"""Stop keys of a terminal, read one by one without Enter.

Without a terminal as standard input there are no keys.
"""

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

try:
    import termios
    import tty
except ImportError:
    # Windows: its terminals have no such modes
    termios = tty = None

STOP_KEYS = b"q "


class Keyboard:
    """Keys of a terminal, or no keys without a terminal."""

    def __init__(self, handle: int | None) -> None:
        """Read the terminal with this file descriptor; None is no terminal."""
        self._handle = handle

    @property
    def there(self) -> bool:
        """Whether there is a terminal to read keys from."""
        return self._handle is not None

    def stop_wanted(self) -> bool:
        """Whether a stop key was pressed since the last call; does not wait."""
        if self._handle is None:
            return False
        wanted = False
        while select.select([self._handle], [], [], 0)[0]:
            keys = _read(self._handle)
            if not keys:
                # the terminal has gone
                self._handle = None
                break
            wanted |= any(key in keys for key in STOP_KEYS)
        return wanted


@contextmanager
def keyboard() -> Iterator[Keyboard]:
    """Keys of standard input during the block; then Enter is needed again."""
    if not (termios and tty) or sys.stdin is None or not sys.stdin.isatty():
        yield Keyboard(None)
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    try:
        tty.setcbreak(handle)
        yield Keyboard(handle)
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)


def _read(handle: int) -> bytes:
    try:
        return os.read(handle, 64)
    except OSError:
        return b""
