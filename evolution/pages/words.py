"""Numbers and names of a report in words."""

import math
import shlex
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from evolution.settings.config import ExperimentConfig
from evolution.settings.config_fields import OptimizerConfig
from evolution.settings.config_files import load_config, shipped_experiments
from evolution.statistics.estimates import FEWEST_FOR_INTERVAL, Interval, quartiles
from evolution.study.data import StudyData

LABELS: Mapping[str, str] = {
    "de-best": "DE/best/1/bin",
    "de-rand": "DE/rand/1/bin",
    "ga": "GA",
    "cma-es": "CMA-ES",
    "lra-cma-es": "LRA-CMA-ES",
    "l-shade": "L-SHADE",
    "one-plus-one-es": "(1+1)-ES",
    "one-plus-one-es-as-first-shipped": "(1+1)-ES, parents evaluated once",
    "random-search": "random search",
    "openai-es": "OpenAI-ES",
    "ssshc": "SSSHC",
    "de-best-then-cma-es": "DE/best/1/bin, then CMA-ES",
    "imitators-then-cma-es": "imitators, then CMA-ES",
    "memetic-de": "memetic DE",
    "lifetime-learning": "lifetime learning",
    "policy-gradient": "policy gradient alone",
    "best": "best: imitators, then CMA-ES, with a margin",
    "de-best-calibrated": "DE/best/1/bin, calibrated",
    "de-best-randomised": "DE/best/1/bin, randomised",
    "ga-randomised": "GA, randomised",
    "robust": "robust: a follower by rule, randomised",
}
"""Names of shipped experiments; any other is called as its user calls it."""

PAPERS = ("de-best", "de-rand", "ga")
"""The experiments of the paper."""

PAPER_BEST = {"de-best": 246.66, "de-rand": 215.217, "ga": 202.775}
"""Maximum fitness of each algorithm. Source: the paper, section 5."""

REPLICATES = 3
"""Number of runs of which the paper reports the best.

The paper says "at least three". Of more runs, a low best would be even rarer.
"""

ROBOT_NAMES: Mapping[str, str] = {
    "epuck_kinematic": "kinematic robot",
    "epuck": "wheeled robot",
    "epuck_cone_kinematic": "kinematic robot that sees cones",
    "epuck_cone": "wheeled robot that sees cones",
}

YARDSTICK_LABEL = "hand-written wall follower"

NOTHING = "-"
"""Text that stands for an unknown value."""


def experiment_label(experiment: str, config: ExperimentConfig | None) -> str:
    """An experiment's name for readers.

    Args:
        experiment: its name.
        config: what it is; a user's own may have the name of a shipped one.
    """
    # a name may end with the number of evaluations
    name, _, end = experiment.rpartition("-")
    if config is not None and name in LABELS and end == str(config.evaluations):
        return f"{experiment_label(name, config)}, {config.evaluations:,} evaluations"
    if config is None or experiment not in LABELS:
        return experiment
    own = config.optimizer != _shipped_optimizer(experiment)
    return experiment if own else LABELS[experiment]


@cache
def _shipped_optimizer(experiment: str) -> OptimizerConfig:
    return load_config(shipped_experiments()[experiment]).optimizer


def label(data: StudyData, experiment: str) -> str:
    """The name for readers of an experiment of a study."""
    return experiment_label(experiment, data.configs[experiment])


def robot_name(robot: str) -> str:
    """A robot's name for readers; that of its file if it is a user's own."""
    return ROBOT_NAMES.get(robot, Path(robot).stem)


def numbered(n: int, noun: str) -> str:
    """A number with its noun: 1 run, 2 runs."""
    return f"{n:,} {noun}" if n == 1 else f"{n:,} {noun}s"


SPREAD = f"Median [quartiles] over runs (below {FEWEST_FOR_INTERVAL}: every run)"
"""Note beside a table of what `spread` writes."""


def spread(sample: np.ndarray, scale: float = 1.0, form: str = "z.1f") -> str:
    """Text with median and quartiles of `(n,)`, or with all values if they are few."""
    if not sample.size:
        return NOTHING
    if sample.size == 1:
        return f"{sample[0] * scale:{form}} (n = 1)"
    found = quartiles(sample * scale)
    if sample.size < FEWEST_FOR_INTERVAL:
        return f"{found.median:{form}} ({_listed(sample * scale, form)})"
    return f"{found.median:{form}} [{found.lower:{form}}, {found.upper:{form}}]"


def _listed(sample: np.ndarray, form: str) -> str:
    return ", ".join(f"{value:{form}}" for value in np.sort(sample))


def median_and_quartiles(sample: np.ndarray, unit: str = "") -> str:
    """Text with median and quartiles of `(n,)`, for a sentence."""
    found = quartiles(sample)
    text = f"median {found.median:.1f}{unit}"
    if sample.size == 1:
        return text
    if sample.size < FEWEST_FOR_INTERVAL:
        return f"{text} ({_listed(sample, '.1f')})"
    return f"{text} (quartiles {found.lower:.1f} and {found.upper:.1f})"


def between(interval: Interval, form: str = ".2f") -> str:
    """Text with the bounds of an interval, or that there are none."""
    low, high = interval.low, interval.high
    if math.isnan(low) or math.isnan(high):
        return "(too few runs for an interval)"
    return f"[{low:{form}}, {high:{form}}]"


def percent(share: float | None) -> str:
    """Text of a share in percent, without the sign; `NOTHING` for None and nan."""
    return NOTHING if share is None or math.isnan(share) else f"{100 * share:.1f}"


def percent_median(shares: np.ndarray) -> str:
    """Text of the median of shares `(n,)` in percent, without the sign."""
    return percent(float(np.median(shares)) if shares.size else None)


def probability(p: float) -> str:
    """A p value with its sign of equality."""
    return "< 0.001" if p < 0.001 else f"= {p:.3f}"


def evaluations(n: float | None) -> str:
    """A number of evaluations."""
    return NOTHING if n is None else f"{n:,.0f}"


def command_line(module: str, *arguments: str) -> str:
    """Shell command that runs a module, the same for every interpreter."""
    return shlex.join(["python", "-m", module, *arguments])
