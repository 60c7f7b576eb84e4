"""The ask/tell protocol of an optimiser and the table of those that are shipped.

The modules behind it do not know this one: `ask_tell` has the shared rules,
`search_space` the box, one module each the algorithms. The baselines beside the paper's
are random search, (1+1)-ES and CMA-ES.

    optimizer = make_optimizer(config.optimizer, config.search_space, rng)
    while spent + optimizer.next_size() <= budget:
        genomes = optimizer.ask()
        optimizer.tell(evaluate(genomes))
        spent += len(genomes)
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from evolution.ask_tell import AskTellError
from evolution.cma_es import CmaEs, CmaEsParameters
from evolution.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionParameters,
)
from evolution.evolution_strategy import EvolutionStrategy, EvolutionStrategyParameters
from evolution.genetic_algorithm import GeneticAlgorithm, GeneticAlgorithmParameters
from evolution.random_search import RandomSearch, RandomSearchParameters
from evolution.search_space import SearchSpace

__all__ = [
    "ALGORITHMS",
    "AskTellError",
    "Optimizer",
    "OptimizerParameters",
    "SearchSpace",
    "make_optimizer",
]


class Optimizer(Protocol):
    """A population-based maximiser that asks for fitness and is told.

    Attributes:
        name: the shipped experiment's with these parameters.
        population: genomes `(population, genes)` after the last tell, read-only; before
            the first tell the initial ones. As many as there are: it may grow.
        fitness: their stored fitness `(population,)`, read-only; -inf before the first
            tell.
        generation: number of tells so far.
    """

    name: str
    population: np.ndarray
    fitness: np.ndarray
    generation: int

    def next_size(self) -> int:
        """Number of genomes the next ask returns: what a generation costs."""
        ...

    def ask(self) -> np.ndarray:
        """Genomes to evaluate `(next_size(), genes)`, the caller's to keep.

        Raises:
            AskTellError: the last genomes have not been told.
        """
        ...

    def to_beat(self) -> np.ndarray:
        """Fitness `(n,)` that each genome asked has to exceed to change anything.

        A genome that cannot may be told any fitness that does not exceed it either;
        -inf where every fitness matters.

        Raises:
            AskTellError: nothing was asked.
        """
        ...

    def tell(self, fitness: ArrayLike) -> None:
        """Accept the fitness `(n,)` of the genomes asked; NaN counts as -inf.

        Raises:
            AskTellError: nothing was asked, or another shape was expected; what was
                asked can still be told.
        """
        ...

    def state(self) -> dict[str, np.ndarray]:
        """Everything the next generations depend on, as plain arrays.

        Raises:
            AskTellError: asked genomes have not been told.
        """
        ...

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on where `state` was taken, with the very same random stream.

        Genomes asked but not told are forgotten. The optimiser must have been made with
        the parameters and the space of the one that was saved; of those, only what
        shows in names and shapes is checked.

        Raises:
            ValueError: not a state of this optimiser, which then stays as it was.
        """
        ...


OptimizerParameters = (
    DifferentialEvolutionParameters
    | GeneticAlgorithmParameters
    | RandomSearchParameters
    | EvolutionStrategyParameters
    | CmaEsParameters
)

Maker = Callable[[Any, SearchSpace, Generator], Optimizer]
# (parameters of that kind, space, rng) -> optimiser
MAKERS: Mapping[type[OptimizerParameters], Maker] = {
    DifferentialEvolutionParameters: DifferentialEvolution,
    GeneticAlgorithmParameters: GeneticAlgorithm,
    RandomSearchParameters: RandomSearch,
    EvolutionStrategyParameters: EvolutionStrategy,
    CmaEsParameters: CmaEs,
}

ALGORITHMS: Mapping[str, type[OptimizerParameters]] = {
    kind.algorithm: kind for kind in MAKERS
}
"""The kinds of parameters by what configurations call their `algorithm`."""


def make_optimizer(
    parameters: OptimizerParameters, space: SearchSpace, rng: Generator
) -> Optimizer:
    """An optimiser at generation 0 of the kind that `parameters` belong to.

    Args:
        parameters: what it is made of.
        space: where it searches.
        rng: the source of all its randomness, its own from here on.

    Raises:
        ValueError: the optimiser cannot search this space.
    """
    return MAKERS[type(parameters)](parameters, space, rng)
