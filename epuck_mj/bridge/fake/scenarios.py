"""Scenarios: faults between the bridge and its robot, and their times.

A scenario is text: `stall@2` is a stall 2 s after the first byte was heard,
`loss@1+0.5,reset@4` are two faults, the first half a second long.
"""

import re
from dataclasses import dataclass

import numpy as np

from epuck_mj.errors import UserError


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    Attributes:
        duration: of it, if nothing else is said [s].
        what: it is, for a person.
    """

    duration: float
    what: str


KINDS = {
    "loss": Kind(0.5, "a byte in fifty is lost, both ways"),
    "garbage": Kind(0.0, "random bytes reach the host"),
    "noise": Kind(0.0, "random bytes reach the robot"),
    "stall": Kind(0.5, "nothing gets through, both ways, and then all of it"),
    "disconnect": Kind(1.0, "the port vanishes, and returns"),
    "gone": Kind(float("inf"), "the port vanishes for ever"),
    "reset": Kind(0.0, "the robot starts anew"),
}
"""The kinds of faults, by name."""

LOSS = 0.02
"""Probability that a byte is lost during the fault `loss`."""

GARBAGE_MAX = 40
"""Largest number of bytes of garbage at once."""


@dataclass(frozen=True)
class Fault:
    """A fault at a time.

    Attributes:
        kind: one of KINDS.
        start: since the first byte was heard [s].
        duration: [s].
    """

    kind: str
    start: float
    duration: float

    def lasts(self, time: float) -> bool:
        """Whether the fault lasts at that time since the first byte [s]."""
        return self.start <= time < self.start + self.duration

    def __str__(self) -> str:
        """The fault as a scenario names it."""
        return f"{self.kind}@{self.start:g}+{self.duration:g}"


def scenario(text: str) -> tuple[Fault, ...]:
    """The faults that a text names.

    Raises:
        UserError: if it cannot be understood.
    """
    faults = []
    for word in filter(None, text.split(",")):
        found = re.fullmatch(r"([a-z]+)@(\d+\.?\d*)(?:\+(\d+\.?\d*|inf))?", word)
        if found is None or found[1] not in KINDS:
            raise UserError(
                f"expected faults as in stall@2 or loss@1+0.5, with commas in between, "
                f"of {', '.join(KINDS)}; got '{word}'"
            )
        duration = found[3] or KINDS[found[1]].duration
        faults.append(Fault(found[1], float(found[2]), float(duration)))
    return tuple(faults)


def random_scenario(seed: int, end: float) -> tuple[Fault, ...]:
    """A random scenario of one to three faults.

    Args:
        seed: decides everything.
        end: none starts later [s].
    """
    rng = np.random.default_rng(seed)
    faults = []
    for kind in rng.choice(list(KINDS), rng.integers(1, 4)):
        duration = KINDS[kind].duration * rng.uniform(0.3, 2.0)
        faults.append(Fault(str(kind), float(rng.uniform(0, end)), duration))
    return tuple(sorted(faults, key=lambda fault: fault.start))
