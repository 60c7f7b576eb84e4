"""A MuJoCo e-puck: model, sensors, motors, controllers, environments for agents."""

import importlib
from typing import TYPE_CHECKING, Any

from epuck_mj.host.loading import prepare as _prepare

if TYPE_CHECKING:
    from epuck_mj.environments.dm_control import SUITE, load
    from epuck_mj.errors import UserError
    from epuck_mj.scene.model import load_scene

# the first of a command's modules: loading the others takes seconds
_prepare()

__all__ = ["SUITE", "UserError", "load", "load_scene"]

_MODULES = {
    "SUITE": "epuck_mj.environments.dm_control",
    "UserError": "epuck_mj.errors",
    "load": "epuck_mj.environments.dm_control",
    "load_scene": "epuck_mj.scene.model",
}


def __getattr__(name: str) -> Any:
    """Import the module of a public name at its first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """Names of the module, including those not yet imported."""
    return sorted({*globals(), *__all__})
