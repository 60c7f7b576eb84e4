"""Evolve controllers for the e-puck: optimisers, experiments, command lines.

`evolution.load("results/paper")` gives the tables of a study as pandas data frames.
"""

import importlib
from typing import TYPE_CHECKING, Any

# first of all: it prepares commands for what may happen while they load
import epuck_mj  # noqa: F401

if TYPE_CHECKING:
    from evolution.frames import Study, load

__all__ = ["Study", "load"]


def __getattr__(name: str) -> Any:
    """Import the module of a public name at its first use (PEP 562)."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("evolution.frames"), name)


def __dir__() -> list[str]:
    """Names of the module, including those not yet imported."""
    return sorted({*globals(), *__all__})
