"""Step fitness: what a control step is worth.

Three forms are shipped. `product` follows the paper's prose about equation (2):
"maximize linear velocity while minimizing both the angular velocity and robot-distance
to the wall". `literal` is equation (2) as printed, where closeness only reduces the
penalty for turning; its optimum is driving circles far from any wall. `spaced` is not
from the paper: it pays most for some distance from the wall. A user's own fitness is a
function in a file, `my.py:name`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host.limits import shown
from epuck_mj.host.own_parts import failure, is_own, own_part


@dataclass(frozen=True)
class StepFacts:
    """What is known of a control step of robots `(...)` once it is over.

    Attributes:
        action: what the policy decided, `(..., 2)`: v in [0, 1], w in [-1, 1].
        command: wheel speeds sent [rad/s], `(..., 2)`.
        observation: network input without noise, `(..., 8)`: 0 near, 1 free.
        distance: metres along each ray without noise, `(..., 8)`; negative where
            nothing was hit.
        contact: whether the robot touched a wall in the step, `(...)`: its trial ends
            here.
        time: since the start, at the end of the step [s]; `(...)` where trials began
            at different times.
        poses: gives `pose` when it is asked for.
        clearances: gives `clearance` when it is asked for.
    """

    action: np.ndarray
    command: np.ndarray
    observation: np.ndarray
    distance: np.ndarray
    contact: np.ndarray
    time: float | np.ndarray
    poses: Callable[[], np.ndarray]
    clearances: Callable[[], np.ndarray]

    @property
    def pose(self) -> np.ndarray:
        """Where the robots are, `(..., 3)`: x, y [m], yaw [rad]; NaN if unknown."""
        return self.poses()

    @property
    def clearance(self) -> np.ndarray:
        """From the shell to the nearest wall [m], `(...)`, 0.2 at most; NaN if unknown.

        It costs about as much as the control step itself.
        """
        return self.clearances()


@dataclass(frozen=True)
class StepFitness:
    """A step fitness and what is known of it.

    Attributes:
        name: as configurations call it.
        function: from what is known of a step to its worth, `(...)`.
        maximum: no step is worth more; None if that is not known, and then individuals
            cannot race.
    """

    name: str
    function: Callable[[StepFacts], np.ndarray]
    maximum: float | None

    def __call__(self, facts: StepFacts) -> np.ndarray:
        """What the step is worth, `(...)`.

        Raises:
            UserError: if the function fails, gives another shape, or more than its
                maximum.
        """
        try:
            worth = np.asarray(self.function(facts), float)
        except Exception as error:
            raise UserError(f"fitness '{self.name}' {failure(error)}") from None
        if worth.shape != facts.contact.shape:
            raise UserError(
                f"fitness '{self.name}': expected one value a robot, shape "
                f"{facts.contact.shape}, got shape {worth.shape}"
            )
        if self.maximum is not None and worth.size and worth.max() > self.maximum:
            raise UserError(
                f"fitness '{self.name}': expected at most its maximum, "
                f"{self.maximum:g}, got {worth.max():g}"
            )
        return worth


def of_most(fitness: float, most: float | None) -> str:
    """Text of a fitness, and of the most that it could be if that is known."""
    return f"{fitness:.1f}" + ("" if most is None else f" of {most:g}")


def fast(action: np.ndarray) -> np.ndarray:
    """Forward drive v in [0, 1], `(...,)`."""
    return action[..., 0]


def turning(action: np.ndarray) -> np.ndarray:
    """Strength of the turn |w| in [0, 1], `(...,)`."""
    return np.abs(action[..., 1])


def close(observation: np.ndarray) -> np.ndarray:
    """Closeness of the nearest thing seen: 1 at contact, 0 when free, `(...,)`."""
    return 1.0 - observation.min(axis=-1)


SPACED_NEAR, SPACED_FAR = 0.2, 0.375
"""Nearest readings between which `spaced` pays most: 8 and 15 mm of a range of 4 cm."""


def at_distance(observation: np.ndarray) -> np.ndarray:
    """How well a robot keeps its distance to the nearest thing seen, `(...,)`.

    1 from `SPACED_NEAR` to `SPACED_FAR`; it falls to 0 at contact and when free.
    """
    nearest = observation.min(axis=-1)
    outside = (1.0 - nearest) / (1.0 - SPACED_FAR)
    return np.minimum(np.minimum(nearest / SPACED_NEAR, outside), 1.0)


def product(action: np.ndarray, observation: np.ndarray) -> np.ndarray:
    """Fast, straight and close to a wall, all at once, `(...,)`.

    Args:
        action: `(..., 2)`, the action just carried out.
        observation: `(..., 8)`, seen after it.
    """
    return fast(action) * (1.0 - turning(action)) * close(observation)


def literal(action: np.ndarray, observation: np.ndarray) -> np.ndarray:
    """Equation (2) as printed, `(...,)`; arguments as for `product`."""
    return fast(action) * (1.0 - turning(action) * close(observation))


def spaced(action: np.ndarray, observation: np.ndarray) -> np.ndarray:
    """Fast, straight and at some distance from a wall, `(...,)`.

    As `product`, but instead of contact it pays most where the nearest reading is from
    `SPACED_NEAR` to `SPACED_FAR`. Arguments as for `product`.
    """
    return fast(action) * (1.0 - turning(action)) * at_distance(observation)


Formula = Callable[[np.ndarray, np.ndarray], np.ndarray]

FORMULAS: MappingProxyType[str, Formula] = MappingProxyType(
    {"product": product, "literal": literal, "spaced": spaced}
)
"""The shipped forms, of action and observation; none is worth more than 1 a step."""


def step_fitness(name: str) -> StepFitness:
    """The step fitness of that name, a shipped one or `my.py:name`.

    The maximum of an own one is the attribute `maximum` of its function.

    Raises:
        UserError: if there is none.
    """
    if name in FORMULAS or is_own(name):
        return _step_fitness(name)
    raise UserError(unknown_fitness(name))


def unknown_fitness(name: object) -> str:
    """What is said of a fitness that there is not."""
    available = ", ".join(sorted(FORMULAS))
    return (
        f"unknown fitness {shown(name)}; available: {available}, or my.py:name for a "
        "function of your own"
    )


@cache
def _step_fitness(name: str) -> StepFitness:
    if name in FORMULAS:
        return StepFitness(name, _until_a_crash(FORMULAS[name]), 1.0)
    function: Any = own_part(name).value
    if not callable(function):
        raise UserError(f"fitness '{name}': expected a function, got {function!r}")
    maximum: Any = getattr(function, "maximum", None)
    known = type(maximum) in (int, float) and math.isfinite(maximum)
    if maximum is not None and not known:
        raise UserError(
            f"fitness '{name}': expected a number as its maximum, got {maximum!r}"
        )
    own: Any = function
    return StepFitness(name, own, maximum)


def _until_a_crash(formula: Formula) -> Callable[[StepFacts], np.ndarray]:
    """A formula; the step that ends in a crash earns nothing.

    Source: paper, section 4: a crash stops the calculation.
    """

    def fitness(facts: StepFacts) -> np.ndarray:
        return np.where(facts.contact, 0.0, formula(facts.action, facts.observation))

    return fitness
