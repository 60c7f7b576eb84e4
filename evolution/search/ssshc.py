"""SSSHC, a stochastic steady state with hill climbing, maximising.

A population of parents is selected in one generation and refined in the following ones:

1. Selection. Parents are evaluated again, together with one mutated offspring of each.
   A parent's fitness is the mean of all evaluations that it has had, an offspring's is
   its only one. For this comparison each is multiplied by 1 + s, with s drawn uniformly
   from [-stochasticity, stochasticity). The best of both kinds are the next parents;
   of equals, offspring are preferred and the first of a kind.
2. Refinement, a number of times. Each parent gets one candidate, which is the parent
   with one gene drawn anew, and is replaced by it iff the candidate's fitness is
   strictly higher than the parent's mean.

The first generation evaluates the initial population, and selection follows. Mutated
genes are drawn uniformly between the bounds. Randomness is drawn in this order: the
initial population; for a selection which genes mutate, their values, and after the
evaluation s, for offspring and then for parents; for a refinement the genes, then their
values.

Source:
    P. Pagliuca, N. Milano and S. Nolfi, PLoS ONE 13 (2018) e0198788, for the stochastic
    steady state; P. Pagliuca, AI 5 (2024) 2393-2432, for hill climbing with it. The
    order of selection and refinement, both mutations, the preference of offspring, 20
    parents and one refinement are those of the program that belongs to the latter
    (bin/ssshc.py of github.com/PaoloP84/evorobotpy3). It has no noise in selection,
    forgets a parent's former evaluations, evaluates candidates from the same starts as
    their parents, and mutates 2 % of the genes. Here every generation has starts of its
    own: therefore a parent's fitness is the mean of all its evaluations, and a
    candidate is compared with that. That noise is a share of the fitness, and how
    large, is this project's reading. With 2 % of 40 genes, 45 % of all offspring are
    copies of their parents; 10 % was better in trials.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from epuck_mj.host.limits import check
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.random_search import best_of
from evolution.search.running_mean import running_mean
from evolution.search.search_space import SearchSpace


def mutate_genes(
    genomes: np.ndarray, probability: float, space: SearchSpace, rng: Generator
) -> np.ndarray:
    """Genomes `(n, genes)` in which each gene is drawn anew with `probability`.

    Args:
        genomes: `(n, genes)`.
        probability: in [0, 1].
        space: between whose bounds genes are drawn.
        rng: draws which genes, then values for all of them, each `(n, genes)`.
    """
    chosen = rng.random(genomes.shape) < probability
    values = rng.uniform(space.lower, space.upper, size=genomes.shape)
    return np.where(chosen, values, genomes)


def mutate_one_gene(
    genomes: np.ndarray, space: SearchSpace, rng: Generator
) -> np.ndarray:
    """Genomes `(n, genes)` in which one gene each is drawn anew.

    Args:
        genomes: `(n, genes)`.
        space: between whose bounds genes are drawn.
        rng: draws the genes, then their values, each `(n,)`.
    """
    n, genes = genomes.shape
    mutated = genomes.copy()
    chosen = rng.integers(genes, size=n)
    values = rng.uniform(space.lower, space.upper, size=n)
    mutated[np.arange(n), chosen] = values
    return mutated


def noisy(fitness: np.ndarray, stochasticity: float, rng: Generator) -> np.ndarray:
    """Fitness `(n,)` times 1 + s, s uniform in [-stochasticity, stochasticity).

    Infinite fitness stays as it is.
    """
    factors = 1 + rng.uniform(-stochasticity, stochasticity, size=len(fitness))
    finite = np.isfinite(fitness)
    return np.where(finite, np.where(finite, fitness, 0) * factors, fitness)


@dataclass(frozen=True)
class SsshcParameters:
    """Parameters of SSSHC.

    Attributes:
        population: number of parents, at least 1. A selection costs twice this
            number of evaluations, a refinement this number.
        mutation: probability in [0, 1] that a gene of an offspring is drawn anew.
        stochasticity: noise of the fitness in selection, as a share of it, in [0, 1].
        refinements: generations of refinement after each selection; 0 is a steady state
            without hill climbing.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    population: int = 20
    mutation: float = 0.1
    stochasticity: float = 0.1
    refinements: int = 1
    algorithm: Literal["ssshc"] = "ssshc"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("population", "mutation", "stochasticity", "refinements"):
            check(name, getattr(self, name))


class Ssshc(Optimizer):
    """The optimiser 'ssshc'.

    Its population are the parents; their stored fitness is the mean of the evaluations
    that each of them has had.
    """

    stores_means = True

    def __init__(
        self, parameters: SsshcParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Draw the first parents; `rng` belongs to the optimiser from here on."""
        shape = (parameters.population, space.genes)
        population = rng.uniform(space.init_lower, space.init_upper, size=shape)
        super().__init__("ssshc", population, rng)
        self._parameters = parameters
        self._space = space
        # number of evaluations of each parent; their mean is stored
        self._evaluations = np.zeros(parameters.population, dtype=np.int64)

    def next_size(self) -> int:
        """See `Optimizer.next_size`."""
        return len(self.population) * (2 if self._selects() else 1)

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: in a refinement the parents' fitness.

        Any other candidate is forgotten. In a selection every fitness matters.
        """
        asked = self.pending()
        if self._selects():
            return np.full(len(asked), -np.inf)
        # -inf at first
        return self.fitness.copy()

    def _selects(self) -> bool:
        """Whether this generation is a selection."""
        cycle = 1 + self._parameters.refinements
        return self.generation > 0 and (self.generation - 1) % cycle == 0

    def propose(self) -> np.ndarray:
        """Parents and offspring for a selection, candidates for a refinement."""
        parents, space, rng = self.population, self._space, self.rng
        if self._selects():
            offspring = mutate_genes(parents, self._parameters.mutation, space, rng)
            return np.concatenate([parents, offspring])
        return mutate_one_gene(parents, space, rng)

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Select the next parents, or let candidates replace theirs if better."""
        n = len(self.population)
        if self.generation == 0:
            self.fitness = read_only(told)
            self._evaluations = np.ones(n, dtype=np.int64)
        elif self._selects():
            self._select(asked[n:], told[n:], told[:n])
        else:
            better = told > self.fitness
            self.population = read_only(
                np.where(better[:, np.newaxis], asked, self.population)
            )
            self.fitness = read_only(np.where(better, told, self.fitness))
            self._evaluations = np.where(better, 1, self._evaluations)

    def _select(
        self, offspring: np.ndarray, offspring_told: np.ndarray, told: np.ndarray
    ) -> None:
        """Make the best of offspring and parents the next parents.

        Args:
            offspring: `(population, genes)`.
            offspring_told: their fitness `(population,)`.
            told: the parents' new fitness `(population,)`.
        """
        n, count = len(told), self._evaluations
        mean = running_mean(self.fitness, count, told)
        genomes = np.concatenate([offspring, self.population])
        fitness = np.concatenate([offspring_told, mean])
        evaluations = np.concatenate([np.ones(n, dtype=np.int64), count + 1])
        compared = noisy(fitness, self._parameters.stochasticity, self.rng)
        kept = best_of(compared, n)
        self.population = read_only(genomes[kept])
        self.fitness = read_only(fitness[kept])
        self._evaluations = evaluations[kept]

    def judge_anew(self, fitness: ArrayLike) -> None:
        """See `Optimizer.judge_anew`: means begin again."""
        super().judge_anew(fitness)
        self._evaluations = np.ones_like(self._evaluations)

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        super().load(arrays)
        self._evaluations = arrays["evaluations"]

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        return {**super().arrays(), "evaluations": self._evaluations.copy()}
