"""Calls that end in time, whatever the system under them does.

Opening a port may wait for a name server, a radio or a driver; closing one waits until
the device has taken what was written. Nothing ends such a call from outside, so it is
left to a thread, which does not keep the process alive.
"""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")


def in_time(
    call: Callable[[], T], seconds: float, late: Callable[[T], object] | None = None
) -> T:
    """The result of a call, if it ends in time.

    Args:
        call: made in a thread of its own.
        seconds: how long it may take.
        late: called with a result that comes after the time.

    Raises:
        TimeoutError: if it takes longer.
        Exception: what the call raises.
    """
    outcome: Future[T] = Future()

    def work() -> None:
        try:
            outcome.set_result(call())
        except BaseException as error:
            outcome.set_exception(error)

    def drop(outcome: Future[T]) -> None:
        if late is not None and outcome.exception() is None:
            late(outcome.result())

    threading.Thread(target=work, daemon=True).start()
    try:
        return outcome.result(seconds)
    except BaseException:
        # too late, or a signal came
        outcome.add_done_callback(drop)
        raise
