"""Standard output and error, which may be closed, full, or read by nobody.

This module imports only the standard library, because it is loaded first.
"""

import contextlib
import errno
import io
import os
import queue
import sys
import threading
from pathlib import Path
from typing import Self, TextIO

from epuck_mj.errors import UserError

OUTPUT_LOST = 1
"""Exit status of a command whose standard output took no more text."""

TEXTS_MAX = 100
"""Texts that wait for a reader; further ones are dropped."""

READER_TIME_MAX = 0.3
"""Time after which somebody who does not read will not read any more [s]. Chosen."""


class OutputLost(UserError):
    """Standard output is closed, or takes no more text."""


class Output:
    """A stream of text that never makes its writer wait.

    Texts that are not read in time are dropped: a terminal may be stopped (Ctrl-S) or
    far away, and a program may forget to read.
    """

    def __init__(self, stream: TextIO | None) -> None:
        """Write to a stream, of which nothing is left to flush.

        Raises:
            OutputLost: if it is closed.
        """
        self._stream = _opened(stream)
        self._failure: OSError | None = None
        self._texts: queue.Queue[str | None] = queue.Queue(TEXTS_MAX)
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()

    @property
    def lost(self) -> bool:
        """Whether the stream did not take a text."""
        return self._failure is not None

    def say(self, text: str, end: str = "\n") -> None:
        """Write a text soon.

        Raises:
            OutputLost: if the stream did not take an earlier one.
        """
        self._refuse_lost()
        with contextlib.suppress(queue.Full):
            self._texts.put_nowait(text + end)

    def finish(self) -> None:
        """Wait until all is written, or dropped.

        Raises:
            OutputLost: if the stream did not take it.
        """
        with contextlib.suppress(queue.Full):
            self._texts.put_nowait(None)
        self._thread.join(READER_TIME_MAX)
        if self._thread.is_alive() or self.lost:
            abandon(self._stream)
        self._refuse_lost()

    def __enter__(self) -> Self:
        """The stream itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Finish; who has to know whether all was written, calls `finish` before."""
        with contextlib.suppress(OutputLost):
            self.finish()

    def _write(self) -> None:
        while (text := self._texts.get()) is not None:
            try:
                _write_at_once(self._stream, text)
            except OSError as error:
                self._failure = error
                return

    def _refuse_lost(self) -> None:
        if self._failure is not None:
            raise OutputLost(
                f"standard output takes no more text: {self._failure.strerror}"
            )


def say(text: str, end: str = "\n") -> None:
    """Write a text to standard output, at once.

    Raises:
        OutputLost: if it is closed, or does not take the text.
    """
    stream = _opened(sys.stdout)
    try:
        _write_at_once(stream, text + end)
    except OSError as error:
        abandon(stream)
        raise OutputLost(
            f"standard output takes no more text: {error.strerror}"
        ) from None


def complain(line: str) -> None:
    """Write a line to standard error or, if that is lost, to standard output."""
    for stream in (sys.stderr, sys.stdout):
        with contextlib.suppress(OutputLost, OSError):
            try:
                with Output(stream) as output:
                    output.say(line)
                    output.finish()
            except (RuntimeError, MemoryError):
                # there is no memory for a thread
                _write_at_once(stream, f"{line}\n")
            return


def standard_streams() -> None:
    """Make standard output and error fit for any text.

    A name that the terminal has no letters for is shown with escapes.

    Raises:
        UserError: if standard output is closed.
    """
    if sys.stderr is None:
        # the parent process has closed it
        sys.stderr = open_nowhere()
    if sys.stdout is None:
        sys.stdout = open_nowhere()
        raise UserError(f"standard output: {os.strerror(errno.EBADF)}")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def open_nowhere() -> TextIO:
    """A stream that drops all text."""
    return Path(os.devnull).open("w", encoding="utf-8")


def give_up_streams() -> None:
    """Drop the text that is left in streams that cannot be written.

    Python's own flush at the end would complain of it.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            abandon(stream)


def abandon(stream: TextIO) -> None:
    """Drop what a stream could not write, so that python can end without a wait."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _opened(stream: TextIO | None) -> TextIO:
    # python has no stream where the shell closed it
    if stream is None or stream.closed:
        raise OutputLost("standard output is closed")
    return stream


def _write_at_once(stream: TextIO, text: str) -> None:
    """Write past the stream's buffer, which python would wait for as it ends."""
    try:
        handle = stream.fileno()
    except io.UnsupportedOperation:
        # not a file, as in notebooks
        stream.write(text)
        stream.flush()
        return
    data = text.encode(stream.encoding or "utf-8", "backslashreplace")
    while data:
        data = data[os.write(handle, data) :]
