"""Step fitness: what a control step is worth, in [0, 1].

Both forms read equation (2) of the paper. Its prose ("maximize linear velocity
while minimizing both the angular velocity and robot-distance to the wall") is
`product`; its print, where closeness only softens the price of turning, is
`literal`, whose optimum is driving circles far from any wall.
"""

from collections.abc import Callable
from types import MappingProxyType

import numpy as np

from epuck_mj.errors import UserError

StepFitness = Callable[[np.ndarray, np.ndarray], np.ndarray]

STEP_FITNESS_MAX = 1.0
"""No control step is worth more."""


def fast(action: np.ndarray) -> np.ndarray:
    """Forward drive v in [0, 1], `(...,)`."""
    return action[..., 0]


def turning(action: np.ndarray) -> np.ndarray:
    """Strength of the turn |w| in [0, 1], `(...,)`."""
    return np.abs(action[..., 1])


def close(observation: np.ndarray) -> np.ndarray:
    """Closeness of the nearest thing seen: 1 at contact, 0 when free, `(...,)`."""
    return 1.0 - observation.min(axis=-1)


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


STEP_FITNESS: MappingProxyType[str, StepFitness] = MappingProxyType(
    {"product": product, "literal": literal}
)


def step_fitness(name: str) -> StepFitness:
    """The step fitness of that name.

    Raises:
        UserError: if there is none.
    """
    if name not in STEP_FITNESS:
        available = ", ".join(sorted(STEP_FITNESS))
        raise UserError(f"unknown fitness '{name}'; available: {available}")
    return STEP_FITNESS[name]
