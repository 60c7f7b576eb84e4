"""Differential evolution, DE/best/1/bin and DE/rand/1/bin, synchronous and maximising.

The whole new generation is built from the old one (Algorithm 1 of the paper): each
individual x gets one trial y, crossed with a mutant u, and is replaced iff
f(y) > f(x). A tie keeps the parent. Randomness is drawn in this order: the initial
population, then for each generation the parents, the crossover, the bounds rule.

Source:
    Algorithm 1 and equation (1) of the paper; the names of the strategies are those of
    Storn and Price, J. Global Optimization 11 (1997) 341-359. What happens to a trial
    outside the bounds is not said there: see `evolution/search/bounds.py`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from epuck_mj.host.limits import check
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.bounds import BOUNDS_RULES, check_bounds_rule
from evolution.search.random_search import best_of
from evolution.search.running_mean import running_mean
from evolution.search.search_space import SearchSpace

# i and three more, all distinct; both strategies draw the same three.
MIN_POPULATION = 4


def distinct_parents(population: int, rng: Generator) -> np.ndarray:
    """Indices r1, r2, r3 `(population, 3)`, distinct in a row and not the row's own.

    Every such triple is equally likely.
    """
    # Ranking random keys shuffles each row; a row's own index is put last.
    keys = rng.random((population, population))
    np.fill_diagonal(keys, np.inf)
    return np.argsort(keys, axis=1)[:, :3]


def rand_1(
    genomes: np.ndarray, best: int, parents: np.ndarray, scale: float
) -> np.ndarray:
    """Mutants of DE/rand/1: u = x_r1 + F (x_r2 - x_r3), equation (1)."""
    r1, r2, r3 = parents.T
    return genomes[r1] + scale * (genomes[r2] - genomes[r3])


def best_1(
    genomes: np.ndarray, best: int, parents: np.ndarray, scale: float
) -> np.ndarray:
    """Mutants of DE/best/1: equation (1) with the best individual as r1.

    As usual, r2 or r3 may be the best too, and the best is also a base for itself.
    """
    _, r2, r3 = parents.T
    return genomes[best] + scale * (genomes[r2] - genomes[r3])


Strategy = Callable[[np.ndarray, int, np.ndarray, float], np.ndarray]
# (genomes (population, genes), best, parents (population, 3), F) -> mutants
STRATEGIES: Mapping[str, Strategy] = {"best": best_1, "rand": rand_1}


def binomial_crossover(
    parents: np.ndarray,
    mutants: np.ndarray,
    crossover: float | np.ndarray,
    rng: Generator,
) -> np.ndarray:
    """Trials `(population, genes)`: mutant where rand_j < CR or j = R, else parent.

    Args:
        parents: `(population, genes)`.
        mutants: `(population, genes)`.
        crossover: CR, of all or of each `(population, 1)`; 0 takes the one gene R from
            the mutant, 1 takes all.
        rng: draws R `(population,)`, then rand `(population, genes)`.
    """
    population, genes = parents.shape
    forced = rng.integers(genes, size=population)
    from_mutant = rng.random((population, genes)) < crossover
    from_mutant[np.arange(population), forced] = True
    return np.where(from_mutant, mutants, parents)


@dataclass(frozen=True)
class DifferentialEvolutionParameters:
    """Parameters of differential evolution.

    Attributes:
        strategy: base of a mutant: best (the best individual) or rand (a random one).
        population: number of individuals N, at least 4.
        scale: F in [0, 2], the differential weight.
        crossover: CR in [0, 1], the probability that a gene comes from the mutant.
        bounds_rule: how a gene outside the bounds is moved: midpoint, none, clip,
            reflect or reinit.
        reevaluate_parents: from the second generation on, evaluate parents and trial
            vectors together, and compare and store their new fitness only. A generation
            then costs 2 N evaluations.
        reevaluate_best: from the second generation on, evaluate this number of best
            individuals again, together with the trial vectors. An individual's fitness
            is then the mean of all its evaluations. A generation costs this number of
            evaluations more. Not with `reevaluate_parents`.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range, an unknown name, or both ways to evaluate
            again.
    """

    strategy: str
    population: int
    scale: float
    crossover: float
    bounds_rule: str = "midpoint"
    reevaluate_parents: bool = False
    reevaluate_best: int = 0
    algorithm: Literal["differential_evolution"] = "differential_evolution"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.strategy not in STRATEGIES:
            raise ValueError(
                f"unknown strategy {self.strategy!r}; "
                f"available: {', '.join(STRATEGIES)}"
            )
        check("population", self.population, least=MIN_POPULATION)
        check("scale", self.scale)
        check("crossover", self.crossover)
        check_bounds_rule(self.bounds_rule)
        check("reevaluate_best", self.reevaluate_best)
        if self.reevaluate_best > self.population:
            raise ValueError(
                f"reevaluate_best: expected 0 to population = {self.population}, "
                f"got {self.reevaluate_best}"
            )
        if self.reevaluate_best and self.reevaluate_parents:
            raise ValueError(
                "reevaluate_best: expected 0 together with reevaluate_parents, "
                f"got {self.reevaluate_best}"
            )


class DifferentialEvolution(Optimizer):
    """The optimiser 'de-best' or 'de-rand', by its strategy.

    Its population are the survivors. Their stored fitness is for ever the one that let
    them in, unless they are evaluated again.
    """

    def __init__(
        self,
        parameters: DifferentialEvolutionParameters,
        space: SearchSpace,
        rng: Generator,
    ) -> None:
        """Draw the initial population; `rng` belongs to the optimiser from here on."""
        shape = (parameters.population, space.genes)
        population = rng.uniform(space.init_lower, space.init_upper, size=shape)
        super().__init__(f"de-{parameters.strategy}", population, rng)
        self.stores_means = parameters.reevaluate_best > 0
        self._parameters = parameters
        self._space = space
        # number of evaluations of each individual; their mean is stored
        self._evaluations = np.ones(parameters.population, dtype=np.int64)

    def next_size(self) -> int:
        """See `Optimizer.next_size`."""
        return len(self.population) + len(self._reevaluated())

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: a trial that does not beat its parent is forgotten.

        Without a limit in the initial population, for individuals evaluated again,
        and for their trials, since it changes what these have to beat.
        """
        self.pending()
        again = self._reevaluated()
        parents = self.fitness.copy()
        parents[again] = -np.inf
        return np.concatenate([np.full(len(again), -np.inf), parents])

    def _reevaluated(self) -> np.ndarray:
        """Indices of the individuals to evaluate again, ascending."""
        parameters = self._parameters
        if self.generation == 0:
            return np.arange(0)
        if parameters.reevaluate_parents:
            return np.arange(len(self.population))
        return best_of(self.fitness, parameters.reevaluate_best)

    def propose(self) -> np.ndarray:
        """The trial vectors, after the individuals that are evaluated again."""
        return np.concatenate([self.population[self._reevaluated()], self._trials()])

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Let each trial replace its parent if it is strictly better."""
        n, again = len(self.population), self._reevaluated()
        # survivors carry the fitness they were compared with, -inf at first
        parent_fitness = self.fitness.copy()
        parent_fitness[again] = self._judged_again(again, told[: len(again)])
        trials, trial_fitness = asked[-n:], told[-n:]
        accepted = trial_fitness > parent_fitness
        self.population = read_only(
            np.where(accepted[:, np.newaxis], trials, self.population)
        )
        self.fitness = read_only(np.where(accepted, trial_fitness, parent_fitness))
        self._evaluations[again] += 1
        self._evaluations[accepted] = 1

    def _judged_again(self, again: np.ndarray, told: np.ndarray) -> np.ndarray:
        """Fitness `(n,)` of individuals `again` `(n,)` that were `told` `(n,)` anew."""
        if self._parameters.reevaluate_parents:
            return told
        return running_mean(self.fitness[again], self._evaluations[again], told)

    def replace(
        self, who: np.ndarray, genomes: np.ndarray, fitness: np.ndarray
    ) -> None:
        """Replace individuals by others, between two generations.

        Args:
            who: indices `(n,)`.
            genomes: `(n, genes)`.
            fitness: theirs, of one evaluation each, `(n,)`.
        """
        self._refuse_pending("replace")
        population, stored = self.population.copy(), self.fitness.copy()
        population[who], stored[who] = genomes, fitness
        self.population, self.fitness = read_only(population), read_only(stored)
        self._evaluations[who] = 1

    def judge_anew(self, fitness: ArrayLike) -> None:
        """See `Optimizer.judge_anew`: means begin again."""
        super().judge_anew(fitness)
        self._evaluations[:] = 1

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        super().load(arrays)
        if self.stores_means:
            self._evaluations = arrays["evaluations"]

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        arrays = super().arrays()
        # only means need it
        if self.stores_means:
            arrays["evaluations"] = self._evaluations.copy()
        return arrays

    def _trials(self) -> np.ndarray:
        """One trial for each individual `(population, genes)`."""
        parameters, space, genomes = self._parameters, self._space, self.population
        parents = distinct_parents(len(genomes), self.rng)
        # On ties the first is the best.
        best = int(np.argmax(self.fitness))
        mutate = STRATEGIES[parameters.strategy]
        mutants = mutate(genomes, best, parents, parameters.scale)
        trials = binomial_crossover(genomes, mutants, parameters.crossover, self.rng)
        keep_inside = BOUNDS_RULES[parameters.bounds_rule]
        return keep_inside(trials, genomes, space.lower, space.upper, self.rng)
