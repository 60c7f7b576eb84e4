"""Random search, maximising: a baseline.

Every generation is drawn uniformly in the initial range, whatever has been told; the
best individuals seen so far are kept. Randomness is drawn in this order: each
generation's genomes, the first when the optimiser is made.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.limits import check
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.search_space import SearchSpace


def best_of(fitness: np.ndarray, n: int) -> np.ndarray:
    """Indices `(n,)`, ascending, of the `n` highest values, the first among equals.

    Args:
        fitness: `(at least n,)`.
        n: how many.
    """
    best_first = np.argsort(-fitness, kind="stable")
    return np.sort(best_first[:n])


@dataclass(frozen=True)
class RandomSearchParameters:
    """Parameters of a random search.

    Attributes:
        population: genomes of a generation, and individuals kept, at least 1.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    population: int = 100
    algorithm: Literal["random_search"] = "random_search"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        check("population", self.population)


class RandomSearch(Optimizer):
    """The optimiser 'random-search'.

    Its population are the best individuals seen so far, the oldest first.
    """

    def __init__(
        self,
        parameters: RandomSearchParameters,
        space: SearchSpace,
        rng: Generator,
    ) -> None:
        """Draw the first genomes; `rng` belongs to the optimiser from here on."""
        self._parameters = parameters
        self._space = space
        super().__init__("random-search", self._drawn(rng), rng)

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: the lowest fitness kept, -inf at first."""
        return np.full(len(self.pending()), self.fitness.min())

    def propose(self) -> np.ndarray:
        """New random genomes `(population, genes)`."""
        return self._drawn(self.rng)

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Keep the best individuals of those kept and asked, the older of equals."""
        if self.generation == 0:
            self.fitness = read_only(told)
            return
        seen = np.concatenate([self.population, asked])
        fitness = np.concatenate([self.fitness, told])
        kept = best_of(fitness, len(asked))
        self.population, self.fitness = read_only(seen[kept]), read_only(fitness[kept])

    def _drawn(self, rng: Generator) -> np.ndarray:
        """Genomes `(population, genes)`, uniform in the initial range."""
        space = self._space
        shape = (self._parameters.population, space.genes)
        return rng.uniform(space.init_lower, space.init_upper, size=shape)
