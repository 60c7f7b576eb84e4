"""Stop keys of a terminal, read one by one without Enter.

Without a terminal as standard input there are no keys.
"""

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

try:
    import termios
    import tty
except ImportError:
    # Windows: its terminals have no such modes
    termios = tty = None

STOP_KEYS = b"q "

KEYS_MAX = 4096
"""Largest number of keys read at once, which is all that a terminal keeps."""


class Keyboard:
    """Keys of a terminal, or no keys without a terminal."""

    def __init__(self, handle: int | None) -> None:
        """Read the terminal with this file descriptor; None is no terminal."""
        self._handle = handle

    @property
    def there(self) -> bool:
        """Whether there is a terminal to read keys from."""
        return self._handle is not None

    def pressed(self) -> bytes:
        """The latest keys; does not wait."""
        if self._handle is None or not select.select([self._handle], [], [], 0)[0]:
            return b""
        keys = _read(self._handle)
        if not keys:
            # the terminal was closed
            self._handle = None
        return keys

    def stop_wanted(self) -> bool:
        """Whether a stop key is among the latest keys; does not wait."""
        keys = self.pressed()
        return any(key in keys for key in STOP_KEYS)


@contextmanager
def keyboard() -> Iterator[Keyboard]:
    """Keys of standard input during the block; then Enter is needed again."""
    if not (termios and tty) or sys.stdin is None or not sys.stdin.isatty():
        yield Keyboard(None)
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    try:
        # at once: a terminal that is stopped (Ctrl-S) never takes what it was sent
        tty.setcbreak(handle, termios.TCSANOW)
        yield Keyboard(handle)
    finally:
        # a closed terminal has no mode to restore
        with suppress(termios.error):
            termios.tcsetattr(handle, termios.TCSANOW, before)


def _read(handle: int) -> bytes:
    try:
        return os.read(handle, KEYS_MAX)
    except OSError:
        return b""
