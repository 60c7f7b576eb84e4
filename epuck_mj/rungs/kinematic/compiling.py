"""Compiling Python functions to machine code, once on a computer.

numba keeps compiled code by the file of each function, and does not notice that a file
which it uses has changed. So the folder's name has a hash of all sources that matter.
"""

import hashlib
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import config as _config
from numba.core import event
from tqdm import tqdm

config: Any = _config
"""numba's settings, whose names no type checker knows."""

_PACKAGE = Path(__file__).resolve().parents[2]

SOURCES = [
    *sorted(Path(__file__).parent.glob("*.py")),
    *sorted((_PACKAGE / "step").glob("*.py")),
    _PACKAGE / "policies" / "follower.py",
    _PACKAGE / "constants.py",
]
"""Files whose functions and constants are compiled."""


def _folders() -> list[Path]:
    """Where compiled code may be kept: with Python's own, or for this user."""
    text = b"".join(path.read_bytes() for path in SOURCES)
    name = f"kinematic-{hashlib.sha256(text).hexdigest()[:16]}"
    folders = [Path(__file__).parent / "__pycache__" / name]
    # the home directory may be unknown
    with suppress(RuntimeError):
        folders.append(Path.home() / ".cache" / "epuck-mj" / name)
    return [folder for folder in folders if _is_writable(folder)]


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / "probe"
        probe.touch()
        probe.unlink(missing_ok=True)
    except OSError:
        return False
    return True


FOLDERS = _folders()
"""The first is used; without any, each process compiles for itself."""


class _Teller(event.Listener):
    """Says, once in a process, that code is compiled that is not in the cache."""

    def __init__(self):
        """Nothing is being compiled."""
        self._depth, self._told, self._since = 0, False, 0.0

    def on_start(self, event: Any) -> None:
        """Say that it takes a while."""
        if self._depth == 0 and not self._told:
            self._since = time.monotonic()
            how = (
                "which is done once on this computer"
                if FOLDERS
                else "in each process anew, as no folder for it can be written"
            )
            _say(f"compiling the kinematic simulator, {how} ...")
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Say how long it took."""
        self._depth -= 1
        if self._depth == 0 and not self._told:
            self._told = True
            _say(f"compiled in {time.monotonic() - self._since:.1f} s")


def _say(line: str) -> None:
    # above a progress bar, if there is one
    with suppress(OSError):
        tqdm.write(line, file=sys.stderr)


event.register("numba:compile", _Teller())


def _forgiving(cache: Any) -> None:
    """Let a cache that is damaged, or cannot be written, cost no more than time."""
    load, save = cache.load_overload, cache.save_overload

    def load_overload(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:
            with suppress(OSError):
                cache.flush()
            return None

    def save_overload(*arguments: Any) -> None:
        with suppress(OSError):
            save(*arguments)

    cache.load_overload, cache.save_overload = load_overload, save_overload


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Decorator that compiles a function at its first call."""
    options |= {
        "nogil": True,
        # division by 0 gives infinity, as in numpy: a check at each would cost much
        "error_model": "numpy",
        # nothing is allocated: else numba counts who uses each array, at each call
        "_nrt": False,
        "cache": bool(FOLDERS),
    }

    def decorate(function: Any) -> Any:
        before = config.CACHE_DIR
        try:
            config.CACHE_DIR = str(FOLDERS[0]) if FOLDERS else ""
            dispatcher: Any = numba.njit(**options)(function)
            if FOLDERS:
                _forgiving(dispatcher._cache)
            return dispatcher
        finally:
            config.CACHE_DIR = before

    return decorate
