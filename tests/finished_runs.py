"""Finished runs made by hand, for tests of what is said about them."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.study.finished_run import FinishedRun


@cache
def config() -> ExperimentConfig:
    """A config; nothing hangs on which one."""
    return load_config(find_config("ga"))


def finished_run(
    seed: int,
    history: dict[str, np.ndarray],
    scores: Any = None,
    champion: Any = None,
) -> FinishedRun:
    """A run with these columns of its history; what is left out is not looked at."""
    return FinishedRun(
        experiment="ga",
        config=config().model_copy(update={"seed": seed}),
        champion=champion,
        scores=scores,
        best_stored=None,
        history=history,
        provenance={},
        path=Path(f"seed-{seed}"),
    )
