"""Limits: one table for configurations, files and command lines.

A value beyond its limit is a mistake, often one of units, or it needs more time or
memory than there is. Products of values, which count as well, are in `memory`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from epuck_mj.errors import UserError

SPEEDS = "speeds are metres a second"
LENGTHS = "lengths are metres"


@dataclass(frozen=True)
class Limit:
    """Smallest and largest value of a number.

    Attributes:
        least: smallest value.
        most: largest value.
        unit: of both.
        why: what a person may have missed, for the message.
        whole: whether it is a whole number.
        above: whether `least` itself is too small.
    """

    least: float
    most: float
    unit: str = ""
    why: str = ""
    whole: bool = True
    above: bool = False

    def allows(self, value: Any) -> bool:
        """Whether a value is a number, no text or boolean, and within the limit."""
        kind = int if self.whole else int | float
        if not isinstance(value, kind) or isinstance(value, bool):
            return False
        if self.above and value <= self.least:
            return False
        return self.least <= value <= self.most

    @property
    def expected(self) -> str:
        """What is expected: `expected a number above 0, at most 0.13 m/s`."""
        kind = "a whole number" if self.whole else "a number"
        low, high = _digits(self.least), f"{_digits(self.most)} {self.unit}".rstrip()
        between = f"above {low}, at most" if self.above else f"from {low} to"
        why = f" ({self.why})" if self.why else ""
        return f"expected {kind} {between} {high}{why}"


def _digits(number: float) -> str:
    whole = isinstance(number, int) and number < 10**12
    return f"{number:,}" if whole else f"{number:g}"


def _above_0(most: float, unit: str = "", why: str = "") -> Limit:
    return Limit(0, most, unit, why, whole=False, above=True)


COUNT = Limit(1, 100_000)
SHARE = Limit(0, 1, whole=False)
FINITE = Limit(-1e100, 1e100, whole=False)
"""Numbers of which a computer can still add and multiply many."""

LIMITS: Mapping[str, Limit] = MappingProxyType(
    {
        # experiments; the paper: 30,000 evaluations of 5 trials of 300 steps
        "seed": Limit(0, 10**24),
        "evaluations": Limit(1, 100_000_000),
        # 0 would be a run that has climbed before it began
        "climb": _above_0(1),
        "finalists": Limit(0, 1000),
        "trials": COUNT,
        "starts_every": Limit(1, 100_000_000),
        "steps": Limit(1, 10_000_000),
        "control_step": _above_0(10, "s"),
        # an e-puck drives at most 0.1288 m/s and turns at most 4.86 rad/s
        "v_max": _above_0(0.13, "m/s", SPEEDS),
        "w_max": _above_0(5, "rad/s"),
        "sensor_range": _above_0(1, "m", LENGTHS),
        "start_clearance": _above_0(1, "m", LENGTHS),
        "body_margin": Limit(0, 0.01, "m", LENGTHS, whole=False),
        "hidden": Limit(1, 1000),
        "weight_bound": _above_0(1_000_000),
        "weight_init": _above_0(1_000_000),
        "validation_starts": COUNT,
        "test_starts": Limit(2, 100_000),
        # their optimisers
        "population": COUNT,
        "lineages": COUNT,
        # levels of more bits are not worth a float64's 53 digits
        "bits": Limit(1, 32),
        "tournament": Limit(1, 10_000),
        "crossover": SHARE,
        "mutation": SHARE,
        "elites": Limit(0, 100_000),
        "scale": Limit(0, 2, whole=False),
        "sigma": _above_0(2_000_000),
        "archive_rate": Limit(0, 10, whole=False),
        "p_best": _above_0(1),
        "memory": Limit(1, 1000),
        # 0 is the run's
        "budget": Limit(0, 100_000_000),
        "crossover_points": Limit(1, 2),
        "reevaluate_best": Limit(0, 100_000),
        "pairs": COUNT,
        "learning_rate": _above_0(2_000_000),
        "weight_decay": SHARE,
        "stochasticity": SHARE,
        "refinements": Limit(0, 100_000),
        # a lesson costs two evaluations: where all learn, two thirds are lessons
        "learning_share": Limit(0, 2 / 3, whole=False),
        "step": _above_0(1_000_000),
        "exploration": _above_0(100),
        "discount": SHARE,
        "demonstrations": COUNT,
        "batch": COUNT,
        # controller files
        "n_genes": COUNT,
        "n_state": Limit(0, 100_000),
        "gene": FINITE,
        "score": FINITE,
        "share": SHARE,
        # calibration files
        "gain": _above_0(100),
        "length": _above_0(1, "m", LENGTHS),
        "latency": Limit(0, 1000, "control steps"),
        "lag": _above_0(100),
        # agents
        "num_envs": COUNT,
        "pixels": Limit(1, 4096),
        "action": Limit(-1_000_000, 1_000_000, whole=False),
        "random": Limit(0, 2**32 - 1, why="or a numpy.random.RandomState, or None"),
        # command lines
        "starts": Limit(2, 100_000),
        "worlds": Limit(2, 1000),
        "threads": Limit(0, 1024),
        "jobs": Limit(0, 1024),
        "seconds": _above_0(24 * 3600, "s"),
    }
)
"""Limits by the name of what is limited: keys, fields of files, flags."""


def check(
    name: str, value: Any, called: str | None = None, least: int | None = None
) -> None:
    """Refuse a value beyond the limit of that name.

    Args:
        name: in the table.
        value: to check.
        called: its name in the message, if that is another.
        least: smallest value where it is used, if that is another.

    Raises:
        ValueError: for such a value, and for what is no number.
    """
    limit = LIMITS[name]
    if least is not None:
        limit = replace(limit, least=least)
    if not limit.allows(value):
        raise ValueError(f"{called or name}: {limit.expected}, got {shown(value)}")


def check_flag(name: str, value: Any, limit: str | None = None) -> None:
    """Refuse a flag's value beyond its limit.

    Args:
        name: of the flag, without hyphens before it.
        value: that was typed.
        limit: name of its limit, if that is another.

    Raises:
        UserError: for such a value.
    """
    try:
        check(limit or name, value, f"--{name}")
    except ValueError as error:
        raise UserError(str(error)) from None


SHOWN_MAX = 60
"""Most characters of a value that a message shows."""


def shown(value: Any) -> str:
    """A value as a part of one line, however large it is."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):
        # Python writes no whole number of more than 4300 digits
        text = f"a very large {type(value).__name__}"
    return text if len(text) <= SHOWN_MAX else f"{text[: SHOWN_MAX - 3]}..."
