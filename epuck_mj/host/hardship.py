"""What this computer lacks, in one line: memory, room on a disk, a stream, a file.

Only what every Python has is imported: this is there before all else is loaded.
"""

import errno
import io
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from epuck_mj.errors import UserError

NO_MEMORY = (
    # MuJoCo
    "Could not allocate memory",
    # libraries that are loaded
    "Cannot allocate memory",
    "cannot allocate memory",
    "failed to map segment",
    "std::bad_alloc",
    # threads need a stack
    "can't start new thread",
)
"""What libraries say when there is no memory, whatever they raise."""


def hardship(error: BaseException) -> str | None:
    """What the computer lacked, in one line; None if the program itself is at fault."""
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError) or any(part in text for part in NO_MEMORY):
        return f"not enough memory: {text}" if text else "not enough memory"
    if isinstance(error, OSError):
        name = error.filename2 or error.filename
        reason = error.strerror or text or type(error).__name__
        return reason if name is None else f"'{os.fsdecode(name)}': {reason}"
    if isinstance(error, UnicodeEncodeError):
        part = error.object[error.start : error.end]
        return f"cannot be written as {error.encoding}: {part!a}"
    return None


def standard_streams() -> None:
    """Make standard output and error fit for any text.

    A name that the terminal has no letters for is shown with escapes.

    Raises:
        UserError: if standard output is closed.
    """
    if sys.stderr is None:
        # nobody wants to read it
        sys.stderr = open_nowhere()
    if sys.stdout is None:
        sys.stdout = open_nowhere()
        raise UserError(f"standard output: {os.strerror(errno.EBADF)}")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def open_nowhere() -> TextIO:
    """A stream that forgets everything."""
    return Path(os.devnull).open("w", encoding="utf-8")


def complain(line: str) -> None:
    """Write an error's line, if there is somebody to read it."""
    with suppress(OSError):
        print(f"error: {line}", file=sys.stderr, flush=True)


def give_up_streams() -> None:
    """Let streams that cannot be written forget what they hold.

    Python's own flush at the end would complain of it.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
