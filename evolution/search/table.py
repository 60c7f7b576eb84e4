"""The table of the optimisers that are shipped.

The modules behind it do not know this one: `ask_tell` has what they share,
`search_space` the box, one module each the algorithms. The baselines beside the paper's
are random search, (1+1)-ES and CMA-ES.

    optimizer = make_optimizer(config.optimizer, config.search_space, rng)
    while spent + optimizer.next_size() <= budget:
        genomes = optimizer.ask()
        optimizer.tell(evaluate(genomes))
        spent += len(genomes)
"""

from collections.abc import Callable, Mapping
from typing import Any

from numpy.random import Generator

from evolution.search.ask_tell import AskTellError, Optimizer
from evolution.search.cma_es import CmaEs, CmaEsParameters
from evolution.search.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionParameters,
)
from evolution.search.evolution_strategy import (
    EvolutionStrategy,
    EvolutionStrategyParameters,
)
from evolution.search.genetic_algorithm import (
    GeneticAlgorithm,
    GeneticAlgorithmParameters,
)
from evolution.search.random_search import RandomSearch, RandomSearchParameters
from evolution.search.search_space import SearchSpace

__all__ = [
    "ALGORITHMS",
    "AskTellError",
    "Optimizer",
    "OptimizerParameters",
    "SearchSpace",
    "make_optimizer",
]


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
