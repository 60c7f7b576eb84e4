"""The ask/tell protocol of an optimiser and the table of those that are shipped.

The three modules behind it do not know this one: `ask_tell` has the shared rules,
`differential_evolution` and `genetic_algorithm` the algorithms.

    optimizer = make_optimizer(default_parameters("de-best"), space, rng)
    while spent + optimizer.next_size() <= budget:
        genomes = optimizer.ask()
        optimizer.tell(evaluate(genomes))
        spent += len(genomes)
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from evolution.ask_tell import AskTellError, SearchSpace
from evolution.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionParameters,
)
from evolution.genetic_algorithm import GeneticAlgorithm, GeneticAlgorithmParameters

__all__ = [
    "OPTIMIZERS",
    "AskTellError",
    "Optimizer",
    "OptimizerParameters",
    "SearchSpace",
    "default_parameters",
    "make_optimizer",
]


class Optimizer(Protocol):
    """A population-based maximiser that asks for fitness and is told.

    Attributes:
        name: its name in `OPTIMIZERS`.
        population: genomes `(population, genes)` after the last tell, read-only; before
            the first tell the initial ones.
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


OptimizerParameters = DifferentialEvolutionParameters | GeneticAlgorithmParameters

# The paper's three (section 4); what it leaves open is at the project's defaults.
OPTIMIZERS: Mapping[str, OptimizerParameters] = {
    "de-best": DifferentialEvolutionParameters(
        strategy="best", population=150, scale=0.8, crossover=1.0
    ),
    "de-rand": DifferentialEvolutionParameters(
        strategy="rand", population=120, scale=0.7, crossover=1.0
    ),
    "ga": GeneticAlgorithmParameters(),
}


def default_parameters(name: str) -> OptimizerParameters:
    """The parameters of the paper for the optimiser called `name`.

    Raises:
        ValueError: no such optimiser.
    """
    if name not in OPTIMIZERS:
        raise ValueError(
            f"unknown optimiser {name!r}; available: {', '.join(OPTIMIZERS)}"
        )
    return OPTIMIZERS[name]


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
    if isinstance(parameters, DifferentialEvolutionParameters):
        return DifferentialEvolution(parameters, space, rng)
    return GeneticAlgorithm(parameters, space, rng)
