"""Imitators: networks that were taught to act like the hand-written wall follower.

The first and only generation: random genomes, each taught by gradient on what the
follower did in some trials, which are paid. It is a beginning for other searches, see
`sequence`; on its own it goes on with copies of itself.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.limits import check
from evolution.search.adam import Adam
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.learning_rules import imitation_gradient
from evolution.search.lessons import Demonstration, Lessons
from evolution.search.search_space import SearchSpace

FIT_STEPS, FIT_SAMPLES = 400, 256
"""Gradient steps of teaching, and control steps that each of them looks at. Chosen."""


@dataclass(frozen=True)
class ImitatorsParameters:
    """Parameters of imitators.

    Attributes:
        population: number of imitators, at least 1.
        demonstrations: evaluations in which the wall follower drives, at least 1.
        learning_rate: first length of the steps of a weight, which falls to 0.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    population: int = 30
    demonstrations: int = 20
    learning_rate: float = 0.1
    algorithm: Literal["imitators"] = "imitators"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("population", "demonstrations", "learning_rate"):
            check(name, getattr(self, name))


class Imitators(Optimizer):
    """The optimiser 'imitators'."""

    needs_lessons = True

    def __init__(
        self, parameters: ImitatorsParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Draw the genomes that are taught; `rng` belongs to it from here on."""
        shape = (parameters.population, space.genes)
        population = rng.uniform(space.init_lower, space.init_upper, size=shape)
        super().__init__("imitators", population, rng)
        self._parameters = parameters
        self._space = space

    def next_cost(self) -> int:
        """See `Optimizer.next_cost`: demonstrations come first."""
        lessons = 0 if self.generation else self._parameters.demonstrations
        return self.next_size() + lessons

    def learn_in_life(self, lessons: Lessons) -> None:
        """See `Optimizer.learn_in_life`: all learn from the wall follower."""
        if self.generation == 0:
            shown = lessons.demonstrate(self._parameters.demonstrations)
            self.replace_pending(self._taught(self.pending(), lessons, shown))

    def propose(self) -> np.ndarray:
        """The same genomes again."""
        return self.population

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Store what was told last."""
        self.population, self.fitness = read_only(asked), read_only(told)

    def _taught(
        self, genomes: np.ndarray, lessons: Lessons, shown: Demonstration
    ) -> np.ndarray:
        """Genomes `(n, genes)` after Adam's steps on parts of what was shown."""
        space, network, adam = self._space, lessons.network, Adam(genomes.shape)
        shape = (len(genomes), FIT_SAMPLES)
        for step in range(FIT_STEPS):
            looked_at = self.rng.integers(len(shown.observation), size=shape)
            uphill = imitation_gradient(
                network, genomes, shown.observation[looked_at], shown.action[looked_at]
            )
            rate = self._parameters.learning_rate * (1 - step / FIT_STEPS)
            genomes = genomes + rate * adam.step(uphill)
            genomes = np.clip(genomes, space.lower, space.upper)
        return genomes
