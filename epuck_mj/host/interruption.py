"""Ctrl-C, kill and a closed terminal as one exception, raised only where allowed.

Code that stops motors or completes files must not be interrupted, not even by a first
signal. So a signal raises an exception only inside `raising`; elsewhere it is
remembered.
"""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Self

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP")
"""Names of the signals of Ctrl-C, kill, a closed terminal, Ctrl-Backslash and Ctrl-Z.

Ctrl-Z would suspend who drives a robot, which would drive on: it ends things as well.
"""

SIGNALS = tuple(getattr(signal, name) for name in NAMES if hasattr(signal, name))


class Interrupted(BaseException):
    """A signal asked the program to end."""


class Interruption:
    """The signals' handler while its `with` block lasts.

    Attributes:
        signum: the first signal that came; None if none did.
    """

    def __init__(self, *signals: signal.Signals) -> None:
        """Store the signals to handle, all of `SIGNALS` by default."""
        self._signals = signals or SIGNALS
        self.signum: signal.Signals | None = None
        self._raises = False
        self._previous: dict[signal.Signals, Any] = {}

    @property
    def status(self) -> int:
        """Exit status of a process that a signal has ended."""
        return 128 + (self.signum or 0)

    def __enter__(self) -> Self:
        """Handle the signals."""
        for signum in self._signals:
            self._previous[signum] = signal.signal(signum, self._handle)
        return self

    def __exit__(self, *exception: object) -> None:
        """Restore the handlers of before; ignore further signals if one came.

        Then the process is at its end, whose status must say so.
        """
        for signum, handler in self._previous.items():
            ended = self.signum is not None
            signal.signal(signum, signal.SIG_IGN if ended else handler)

    @contextmanager
    def raising(self) -> Iterator[None]:
        """Raise `Interrupted` once for a signal in the block or before it.

        Raises:
            Interrupted: for the first signal.
        """
        try:
            self._raises = True
            if self.signum is not None:
                raise Interrupted
            with not_dropped(Interrupted, self._raise_again):
                yield
        except Exception as error:
            # the interrupted code may have failed while it cleaned up
            if follows(error, Interrupted):
                raise Interrupted from error
            raise
        finally:
            self._raises = False

    def _raise_again(self) -> None:
        self._raises = True
        send_soon(self.signum or signal.SIGINT)

    def _handle(self, signum: int, frame: object) -> None:
        if self.signum is None:
            self.signum = signal.Signals(signum)
        if self._raises:
            self._raises = False
            raise Interrupted


@contextmanager
def not_dropped(
    kind: type[BaseException], again: Callable[[], object]
) -> Iterator[None]:
    """Raise a signal's exception again if Python drops it in the block.

    A signal may come while a finaliser runs, out of which nothing can be raised: Python
    prints the exception and goes on.

    Args:
        kind: of the exception.
        again: called for a dropped one, to have the signal come again.
    """
    before = sys.unraisablehook

    def hook(unraisable: "sys.UnraisableHookArgs") -> None:
        if isinstance(unraisable.exc_value, kind):
            again()
        else:
            before(unraisable)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


SOON = 0.01
"""Time in which a finaliser ends [s]."""


def send_soon(signum: signal.Signals) -> None:
    """Send a signal to this process in a moment."""
    threading.Timer(SOON, send, [signum]).start()


def send(signum: signal.Signals) -> None:
    """Send a signal to this process, from any thread."""
    # to the thread that handles it, which may be waiting
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signum)
    else:
        signal.raise_signal(signum)


def follows(error: BaseException, kind: type[BaseException]) -> bool:
    """Whether an exception was raised while one of another kind was handled."""
    cause = error.__cause__ or error.__context__
    while cause is not None and not isinstance(cause, kind):
        cause = cause.__cause__ or cause.__context__
    return cause is not None


@contextmanager
def ignoring_interrupts() -> Iterator[None]:
    """Let processes that any thread starts in the block ignore Ctrl-C.

    A Ctrl-C during the block is lost.
    """
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Let processes that this thread starts in the block ignore Ctrl-C.

    Signals during the block reach this process when the block ends: a process that is
    being started gets all that it needs.
    """
    if not hasattr(signal, "pthread_sigmask"):
        with ignoring_interrupts():
            yield
        return
    # needed only where processes are started
    from multiprocessing import resource_tracker

    # the tracker lets signals in again as it starts, so it starts before the block
    resource_tracker.ensure_running()
    with _signals_kept():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _signals_kept() -> Iterator[None]:
    """Keep back the signals that Python code handles until the block has ended.

    A thread's mask does not do that: another thread of the process may get the signal,
    and its handler then runs in the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {signum: signal.getsignal(signum) for signum in SIGNALS}
    handled = {signum: given for signum, given in before.items() if callable(given)}
    for signum in handled:
        signal.signal(signum, lambda signum, _: came.append(signum))
    try:
        yield
    finally:
        for signum, handler in handled.items():
            signal.signal(signum, handler)
        for signum in came:
            signal.raise_signal(signum)
