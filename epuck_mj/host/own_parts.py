"""Own parts: functions and classes of a user's Python, by the name of their file.

`my.py:name` stands in a file, `package.module:name` in an installed module. Loading one
runs that file, as importing it does.
"""

import hashlib
import importlib
import sys
import traceback
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from epuck_mj.errors import UserError


@dataclass(frozen=True)
class OwnPart:
    """Something that a user wrote.

    Attributes:
        value: the function or class itself.
        sha256: of the file that it stands in, as it was when it was loaded.
    """

    value: Any
    sha256: str


def is_own(name: str) -> bool:
    """Whether a name is that of an own part, and not of a shipped one."""
    return ":" in name


def located(name: str) -> str:
    """The name of a part that means the same from any folder."""
    place, _, what = name.rpartition(":")
    if place.endswith(".py"):
        return f"{Path(place).resolve()}:{what}"
    return name


def own_part(name: str) -> OwnPart:
    """The part of that name, loaded once in a process.

    Raises:
        UserError: if there is no such file, module or name, or it cannot be loaded.
    """
    return _loaded(located(name))


@cache
def _loaded(name: str) -> OwnPart:
    place, _, what = name.rpartition(":")
    if not place or not what.isidentifier():
        raise UserError(f"expected file.py:name or package.module:name, got '{name}'")
    load = _from_file if place.endswith(".py") else _installed
    module, source = load(place)
    if not hasattr(module, what):
        names = [key for key in vars(module) if not key.startswith("_")]
        raise UserError(
            f"no '{what}' in '{place}'; available: {', '.join(names) or 'nothing'}"
        )
    return OwnPart(getattr(module, what), hashlib.sha256(source).hexdigest())


@cache
def _from_file(path: str) -> tuple[ModuleType, bytes]:
    """The module that a file makes, and the bytes that made it."""
    try:
        source = Path(path).read_bytes()
    except OSError as error:
        raise UserError(f"cannot read '{path}': {error.strerror}") from None
    # a name of its own: the user's my.py may not hide a module
    digest = hashlib.sha256(path.encode()).hexdigest()[:12]
    module = ModuleType(f"own_{Path(path).stem}_{digest}")
    module.__file__ = path
    sys.modules[module.__name__] = module
    try:
        exec(compile(source, path, "exec"), module.__dict__)
    except Exception as error:
        del sys.modules[module.__name__]
        raise UserError(f"'{path}' {failure(error, path)}") from None
    return module, source


def _installed(name: str) -> tuple[ModuleType, bytes]:
    """An installed module, and the bytes of its file."""
    try:
        module = importlib.import_module(name)
        source = Path(str(module.__file__)).read_bytes()
    except (ImportError, OSError) as error:
        raise UserError(f"cannot import '{name}': {error}") from None
    except Exception as error:
        raise UserError(f"'{name}' {failure(error)}") from None
    return module, source


def failure(error: Exception, path: str | None = None) -> str:
    """What went wrong in a user's code, and where, in part of a line.

    Args:
        error: that the code raised.
        path: of the code; None for the innermost line, wherever it is.
    """
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if path in (None, frame.filename)]
    if isinstance(error, SyntaxError):
        lines = [error.lineno] if error.lineno else []
    where = f"in line {lines[-1]} " if lines else ""
    what = " ".join(str(error).split())
    return f"failed {where}with {type(error).__name__}: {what}"
