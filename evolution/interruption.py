"""Ctrl-C and SIGTERM: one exception for both, and no second one while tidying up."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(BaseException):
    """A person or the system wants an end; `status` is what the shell expects."""

    def __init__(self, signum: int):
        """Name the signal."""
        super().__init__(signum)
        self.status = 128 + signum


@contextmanager
def interruptible() -> Iterator[None]:
    """Turn SIGINT and SIGTERM into `Interrupted`; further ones are ignored."""

    def interrupt(signum: int, frame: object) -> None:
        # a second one must not break what is being put in order
        for each in SIGNALS:
            signal.signal(each, signal.SIG_IGN)
        raise Interrupted(signum)

    previous = {signum: signal.signal(signum, interrupt) for signum in SIGNALS}
    interrupted = False
    try:
        yield
    except Interrupted:
        interrupted = True
        raise
    finally:
        if not interrupted:
            for signum, handler in previous.items():
                signal.signal(signum, handler)
