"""The lock of a directory: one process at a time works in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from epuck_mj.errors import UserError
from epuck_mj.host import files

LOCK = ".lock"
"""File that is locked by the process that works in a directory."""


@contextmanager
def locked(directory: Path, patience: float = 0.0) -> Iterator[None]:
    """Lock a directory against other processes for the block.

    Args:
        directory: made if it is not there.
        patience: how long to wait for another process to leave [s].

    Raises:
        UserError: if another process stays, or the directory cannot be made.
    """
    with files.writing():
        directory.mkdir(parents=True, exist_ok=True)
    lock = FileLock(directory / LOCK, timeout=patience)
    try:
        lock.acquire()
    except Timeout:
        raise UserError(
            f"another process is working in '{directory}': wait for it, or stop it"
        ) from None
    except OSError as error:
        raise UserError(f"cannot write output '{directory}': {error.strerror}") from (
            None
        )
    try:
        yield
    finally:
        lock.release()
