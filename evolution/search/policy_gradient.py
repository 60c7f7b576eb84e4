"""Policy gradient, a baseline without evolution: one controller learns from trials.

In each generation the controller explores in as many evaluations as a batch has, moves
along the gradient estimated from them, by Adam, and is evaluated. Randomness is drawn
once, for the first genome.

Source:
    R. J. Williams, Machine Learning 8 (1992) 229-256 (REINFORCE). Batch, steps and
    baseline are this project's choices.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.limits import check
from evolution.search.adam import Adam
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.learning_rules import Rule, policy_gradient
from evolution.search.lessons import Lessons
from evolution.search.search_space import SearchSpace


@dataclass(frozen=True)
class PolicyGradientParameters:
    """Parameters of a policy gradient.

    Attributes:
        batch: evaluations in which the controller explores in each generation.
        learning_rate: of Adam: length of the steps of a weight.
        exploration: standard deviation of the noise that is added to the weighted
            sums of v and w.
        discount: factor of a reward one control step later.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    batch: int = 20
    learning_rate: float = 0.03
    exploration: float = 1.0
    discount: float = 0.95
    algorithm: Literal["policy_gradient"] = "policy_gradient"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("batch", "learning_rate", "exploration", "discount"):
            check(name, getattr(self, name))


class PolicyGradient(Optimizer):
    """The optimiser 'policy-gradient'; its population is one controller."""

    needs_lessons = True

    def __init__(
        self, parameters: PolicyGradientParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Draw the first genome; `rng` belongs to the optimiser from here on."""
        population = rng.uniform(
            space.init_lower, space.init_upper, size=(1, space.genes)
        )
        super().__init__("policy-gradient", population, rng)
        self._parameters = parameters
        self._space = space
        self._rule = Rule(0.0, parameters.exploration, parameters.discount)
        self._adam = Adam(population.shape)

    def next_cost(self) -> int:
        """See `Optimizer.next_cost`."""
        return self.next_size() + self._parameters.batch

    def propose(self) -> np.ndarray:
        """The controller as it is."""
        return self.population

    def learn_in_life(self, lessons: Lessons) -> None:
        """See `Optimizer.learn_in_life`: explore and take one step."""
        genomes, space = self.pending(), self._space
        tried = np.repeat(genomes, self._parameters.batch, axis=0)
        life = lessons.live(tried, self._rule.exploration).of(1)
        uphill = policy_gradient(lessons.network, genomes, life, self._rule)
        step = self._parameters.learning_rate * self._adam.step(uphill)
        self.replace_pending(np.clip(genomes + step, space.lower, space.upper))

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Store the controller and its fitness."""
        self.population, self.fitness = read_only(asked), read_only(told)

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        super().load(arrays)
        self._adam.load(arrays)

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        return {**super().arrays(), **self._adam.arrays()}
