"""Evolve controllers for the e-puck: optimisers, experiments, command lines.

`evolution.load("results/paper")` gives the tables of a study as pandas data frames.
"""

import importlib
from typing import TYPE_CHECKING, Any

# first, because it handles errors and signals while commands load
import epuck_mj  # noqa: F401

if TYPE_CHECKING:
    from evolution.frames import Study, load
    from evolution.judging.evaluation import BatchEngine, Evaluation
    from evolution.judging.held_out import Judge
    from evolution.judging.scores import HeldOut, Scores, read_champion
    from evolution.run.generation_loop import Evolution
    from evolution.run.history import Record
    from evolution.search.ask_tell import Optimizer
    from evolution.search.properties import check_optimizer
    from evolution.search.search_space import SearchSpace
    from evolution.search.table import make_optimizer
    from evolution.settings.config import ExperimentConfig
    from evolution.settings.config_files import find_config, load_config
    from evolution.study.addresses import champion_at
    from evolution.study.config import StudyConfig

__all__ = [
    "BatchEngine",
    "Evaluation",
    "Evolution",
    "ExperimentConfig",
    "HeldOut",
    "Judge",
    "Optimizer",
    "Record",
    "Scores",
    "SearchSpace",
    "Study",
    "StudyConfig",
    "champion_at",
    "check_optimizer",
    "find_config",
    "load",
    "load_config",
    "make_optimizer",
    "read_champion",
]

_MODULES = {
    "BatchEngine": "evolution.judging.evaluation",
    "Evaluation": "evolution.judging.evaluation",
    "Evolution": "evolution.run.generation_loop",
    "ExperimentConfig": "evolution.settings.config",
    "HeldOut": "evolution.judging.scores",
    "Judge": "evolution.judging.held_out",
    "Optimizer": "evolution.search.ask_tell",
    "Record": "evolution.run.history",
    "Scores": "evolution.judging.scores",
    "SearchSpace": "evolution.search.search_space",
    "Study": "evolution.frames",
    "StudyConfig": "evolution.study.config",
    "champion_at": "evolution.study.addresses",
    "check_optimizer": "evolution.search.properties",
    "find_config": "evolution.settings.config_files",
    "load": "evolution.frames",
    "load_config": "evolution.settings.config_files",
    "make_optimizer": "evolution.search.table",
    "read_champion": "evolution.judging.scores",
}


def __getattr__(name: str) -> Any:
    """Import the module of a public name at its first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """Names of the module, including those not yet imported."""
    return sorted({*globals(), *__all__})
