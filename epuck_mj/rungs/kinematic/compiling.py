"""Compiling Python functions to machine code, once on a computer.

numba keeps compiled code by the file of each function, and does not notice that a file
which it uses has changed. So the folder's name has a hash of all sources that matter.
"""

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import config as _config

config: Any = _config
"""numba's settings, whose names no type checker knows."""

_PACKAGE = Path(__file__).resolve().parents[2]

SOURCES = [
    *sorted(Path(__file__).parent.glob("*.py")),
    *sorted((_PACKAGE / "step").glob("*.py")),
    _PACKAGE / "constants.py",
]
"""Files whose functions and constants are compiled."""


def _folders() -> list[Path]:
    """Where compiled code may be kept: with Python's own, or for this user."""
    text = b"".join(path.read_bytes() for path in SOURCES)
    name = f"kinematic-{hashlib.sha256(text).hexdigest()[:16]}"
    folders = [Path(__file__).parent / "__pycache__" / name]
    # not everybody has a home
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


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Decorator that compiles a function at its first call."""
    # division by 0 gives infinity, as in numpy: a check at each would cost much
    options |= {"nogil": True, "error_model": "numpy", "cache": bool(FOLDERS)}

    def decorate(function: Any) -> Any:
        before = config.CACHE_DIR
        try:
            config.CACHE_DIR = str(FOLDERS[0]) if FOLDERS else ""
            return numba.njit(**options)(function)
        finally:
            config.CACHE_DIR = before

    return decorate
