"""Numbers and names of a report in words."""

import math
import shlex
from collections.abc import Mapping

import numpy as np

from evolution.statistics.estimates import FEWEST_FOR_INTERVAL, Interval, quartiles

LABELS: Mapping[str, str] = {
    "de-best": "DE/best/1/bin",
    "de-rand": "DE/rand/1/bin",
    "ga": "GA",
    "cma-es": "CMA-ES",
    "one-plus-one-es": "(1+1)-ES",
    "random-search": "random search",
}
"""Names of shipped experiments for readers."""

PAPERS = ("de-best", "de-rand", "ga")
"""The experiments of the paper."""

ROBOT_NAMES: Mapping[str, str] = {
    "epuck_planar": "planar robot",
    "epuck": "wheeled robot",
}

YARDSTICK_LABEL = "hand-written wall follower"

NOTHING = "-"
"""Text that stands for an unknown value."""


def label(experiment: str) -> str:
    """An experiment's name for readers."""
    return LABELS.get(experiment, experiment)


def robot_name(robot: str) -> str:
    """A robot's name for readers."""
    return ROBOT_NAMES.get(robot, robot)


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
    """Text of a share in percent; None and nan are unknown."""
    return NOTHING if share is None or math.isnan(share) else f"{share:.1%}"


def percent_median(shares: np.ndarray) -> str:
    """The median of shares `(n,)` in percent."""
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
