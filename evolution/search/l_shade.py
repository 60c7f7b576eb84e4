"""L-SHADE: differential evolution that learns F and CR and shrinks, maximising.

Each individual x gets one trial, crossed with the mutant of current-to-pbest/1, with F
and CR of its own. Those are drawn around one of H remembered pairs; a generation with
successes writes their weighted means over the oldest pair. Parents that were beaten go
to an archive, where mutants find differences. The population shrinks linearly to 4 over
a budget of evaluations.

Randomness is drawn in this order: the initial population; for each generation the pair
of each individual, CR, F (again where it was not positive), pbest, r1, r2, the
crossover; when told, the places in the archive and, where that shrinks, who stays.

Source:
    R. Tanabe and A. Fukunaga, Improving the Search Performance of SHADE Using Linear
    Population Size Reduction, IEEE Congress on Evolutionary Computation (2014)
    1658-1665. Equations (1) to (10) and algorithms 1 and 2 are those of this paper,
    from memory. What it leaves open: there are at least two pbest, as in the authors'
    program; the initial population is not reduced; an improvement that is infinite,
    which has no weight, counts as the largest finite one.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from epuck_mj.host.limits import check
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.bounds import midpoint
from evolution.search.differential_evolution import binomial_crossover
from evolution.search.random_search import best_of
from evolution.search.search_space import SearchSpace

# N_min: x, r1, r2 and one more
MIN_POPULATION = 4

MIN_PBEST = 2

TERMINAL = -1.0
"""In the memory of CR: CR is 0 from here on. The paper's symbol is a falsum."""

FIRST_MEMORY = 0.5
"""M_F and M_CR before anything has succeeded."""

SPREAD = 0.1
"""Standard deviation of CR, and scale of the Cauchy distribution of F."""


def drawn_crossovers(memory: np.ndarray, rng: Generator) -> np.ndarray:
    """CR `(n,)` in [0, 1], normal around M_CR, 0 where terminal: equation (1)."""
    drawn = memory + SPREAD * rng.standard_normal(len(memory))
    return np.where(memory == TERMINAL, 0.0, np.clip(drawn, 0, 1))


def drawn_scales(memory: np.ndarray, rng: Generator) -> np.ndarray:
    """F `(n,)` in (0, 1], Cauchy around M_F `(n,)`: equation (2).

    Above 1 it is 1; where it is not positive it is drawn again.
    """
    scales = np.zeros(len(memory))
    while (again := scales <= 0).any():
        cauchy = rng.standard_cauchy(np.count_nonzero(again))
        scales[again] = memory[again] + SPREAD * cauchy
    return np.minimum(scales, 1)


def two_others(
    population: int, archived: int, rng: Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Indices r1 of the population and r2 of population and archive `(population,)`.

    Neither is the row's own, nor are they equal.

    Args:
        population: number of individuals.
        archived: number of genomes in the archive, which come behind them.
        rng: draws r1, then r2.
    """
    own = np.arange(population)
    r1 = rng.integers(population - 1, size=population)
    r1 += r1 >= own
    # those from the smaller taken index on move up, then from the larger
    r2 = rng.integers(population + archived - 2, size=population)
    r2 += r2 >= np.minimum(own, r1)
    r2 += r2 >= np.maximum(own, r1)
    return r1, r2


def weighted_lehmer_mean(values: np.ndarray, weights: np.ndarray) -> float:
    """Sum of w S^2 over sum of w S, equation (7); 0 if all values are.

    The sums are exact before they are rounded, so their order does not matter.

    Args:
        values: S, not negative, `(n,)`.
        weights: w, positive, `(n,)`; they need not add up to 1.
    """
    below = math.fsum(weights * values)
    return math.fsum(weights * values * values) / below if below else 0.0


def improvement_weights(parents: np.ndarray, trials: np.ndarray) -> np.ndarray:
    """Weights of successes `(n,)`, the largest 1: equations (8) and (9).

    Args:
        parents: fitness `(n,)`.
        trials: fitness `(n,)`, each higher than its parent's.
    """
    with np.errstate(over="ignore"):
        gains = trials - parents
    finite = gains[np.isfinite(gains)]
    largest = finite.max(initial=0.0) or 1.0
    return np.minimum(gains, largest) / largest


def with_archived(
    archive: np.ndarray, beaten: np.ndarray, capacity: int, rng: Generator
) -> np.ndarray:
    """The archive `(up to capacity, genes)` with more genomes.

    Args:
        archive: `(n, genes)`, at most `capacity`.
        beaten: to add `(k, genes)`; where there is no place left, one after the other
            takes the place of a random one.
        capacity: largest number of genomes in it.
        rng: draws those places.
    """
    free = capacity - len(archive)
    together, rest = np.concatenate([archive, beaten[:free]]), beaten[free:]
    if capacity:
        # of several in one place the last one stays
        together[rng.integers(capacity, size=len(rest))] = rest
    return together


def reduced_size(initial: int, evaluations: int, budget: int) -> int:
    """Individuals after a number of evaluations, from `initial` to 4: equation (10)."""
    size = round((MIN_POPULATION - initial) / budget * evaluations + initial)
    return max(size, MIN_POPULATION)


@dataclass(frozen=True)
class LShadeParameters:
    """Parameters of L-SHADE.

    The paper's initial population is 18 times the genes, for 10,000 evaluations a gene.
    A run of 30,000 evaluations and 40 genes has 750 a gene: with 720 individuals it
    would have 217 generations, with 100, as SHADE before it, it has about 1,000.
    The other defaults are the paper's.

    Attributes:
        population: first number of individuals, at least 4.
        archive_rate: genomes in the archive, as a multiple of the individuals.
        p_best: share of the population among which pbest is chosen.
        memory: number H of remembered pairs of F and CR.
        budget: evaluations over which the population shrinks; 0: the run's.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    population: int = 100
    archive_rate: float = 2.6
    p_best: float = 0.11
    memory: int = 6
    budget: int = 0
    algorithm: Literal["l_shade"] = "l_shade"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        check("population", self.population, least=MIN_POPULATION)
        check("archive_rate", self.archive_rate)
        check("p_best", self.p_best)
        check("memory", self.memory)
        check("budget", self.budget)


class LShade(Optimizer):
    """The optimiser 'l-shade'.

    Its population are the survivors. Their stored fitness is for ever the one that let
    them in. It counts evaluations, those of `judge_anew` as well.
    """

    def __init__(
        self, parameters: LShadeParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Draw the initial population; `rng` belongs to the optimiser from here on.

        Raises:
            ValueError: a budget of 0.
        """
        check("budget", parameters.budget, least=1)
        shape = (parameters.population, space.genes)
        population = rng.uniform(space.init_lower, space.init_upper, size=shape)
        super().__init__("l-shade", population, rng)
        self._parameters = parameters
        self._space = space
        self._evaluations = 0
        self._archive = np.empty((0, space.genes))
        self._scales = np.full(parameters.memory, FIRST_MEMORY)
        self._crossovers = np.full(parameters.memory, FIRST_MEMORY)
        # index of the pair that is written next
        self._oldest = 0
        # F and CR of the trials that were asked last
        self._f = self._cr = np.empty(0)

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: the last number below the parent's fitness.

        A trial that is as good as its parent takes its place.
        """
        self.pending()
        return np.nextafter(self.fitness, -np.inf)

    def judge_anew(self, fitness: ArrayLike) -> None:
        """See `Optimizer.judge_anew`."""
        super().judge_anew(fitness)
        self._evaluations += len(self.population)

    def propose(self) -> np.ndarray:
        """One trial for each individual `(population, genes)`."""
        genomes, rng, n = self.population, self.rng, len(self.population)
        pair = rng.integers(self._parameters.memory, size=n)
        self._cr = drawn_crossovers(self._crossovers[pair], rng)
        self._f = drawn_scales(self._scales[pair], rng)
        # equation (3)
        n_best = max(round(self._parameters.p_best * n), MIN_PBEST)
        best_first = np.argsort(-self.fitness, kind="stable")
        pbest = best_first[rng.integers(n_best, size=n)]
        r1, r2 = two_others(n, len(self._archive), rng)
        either, f = np.concatenate([genomes, self._archive]), self._f[:, np.newaxis]
        mutants = genomes + f * (genomes[pbest] - genomes)
        mutants += f * (genomes[r1] - either[r2])
        # equation (4)
        space = self._space
        mutants = midpoint(mutants, genomes, space.lower, space.upper, rng)
        # equation (5)
        return binomial_crossover(genomes, mutants, self._cr[:, np.newaxis], rng)

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Let trials replace parents unless they are worse; learn from the better."""
        self._evaluations += len(asked)
        if self.generation == 0:
            self.fitness = read_only(told)
            return
        parents, before = self.population, self.fitness
        # equation (6)
        accepted, success = told >= before, told > before
        self.population = read_only(np.where(accepted[:, np.newaxis], asked, parents))
        self.fitness = read_only(np.where(accepted, told, before))
        if success.any():
            capacity = self._capacity(len(parents))
            beaten = parents[success]
            self._archive = with_archived(self._archive, beaten, capacity, self.rng)
            weights = improvement_weights(before[success], told[success])
            self._remember(self._f[success], self._cr[success], weights)
        self._shrink()

    def _remember(
        self, scales: np.ndarray, crossovers: np.ndarray, weights: np.ndarray
    ) -> None:
        """Write the means of what succeeded over the oldest pair: algorithm 1."""
        k = self._oldest
        self._scales[k] = weighted_lehmer_mean(scales, weights)
        mean = weighted_lehmer_mean(crossovers, weights)
        ends = self._crossovers[k] == TERMINAL or mean == 0
        self._crossovers[k] = TERMINAL if ends else mean
        self._oldest = (k + 1) % self._parameters.memory

    def _shrink(self) -> None:
        """Drop the worst individuals, and random genomes of the archive."""
        parameters = self._parameters
        size = reduced_size(parameters.population, self._evaluations, parameters.budget)
        if size >= len(self.population):
            return
        kept = best_of(self.fitness, size)
        self.population = read_only(self.population[kept])
        self.fitness = read_only(self.fitness[kept])
        capacity = self._capacity(size)
        if len(self._archive) > capacity:
            stay = self.rng.permutation(len(self._archive))[:capacity]
            self._archive = self._archive[np.sort(stay)]

    def _capacity(self, size: int) -> int:
        """Most genomes of the archive of a population of that size."""
        return round(self._parameters.archive_rate * size)

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`.

        Raises:
            ValueError: sizes or counts that cannot be.
        """
        counts = [int(count) for count in arrays["counts"]]
        size, archived, evaluations, oldest = counts
        if not (
            MIN_POPULATION <= size <= self._parameters.population
            and 0 <= archived <= self._capacity(size)
            and evaluations >= 0
            and 0 <= oldest < self._parameters.memory
        ):
            raise ValueError(
                "state array 'counts': expected numbers of individuals, of genomes in "
                f"the archive, of evaluations, and the oldest pair, got {counts}"
            )
        self.population = read_only(arrays["population"][:size])
        self.fitness = read_only(arrays["fitness"][:size])
        self._archive = arrays["archive"][:archived]
        self._scales, self._crossovers = arrays["scales"], arrays["crossovers"]
        self._evaluations, self._oldest = evaluations, oldest

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`: all as long as they can be, filled with 0.

        'counts' says how much of them is used.
        """
        n = self._parameters.population
        counts = (
            len(self.population),
            len(self._archive),
            self._evaluations,
            self._oldest,
        )
        return {
            **super().arrays(),
            "population": _filled(self.population, n),
            "fitness": _filled(self.fitness, n),
            "archive": _filled(self._archive, self._capacity(n)),
            "scales": self._scales.copy(),
            "crossovers": self._crossovers.copy(),
            "counts": np.array(counts),
        }


def _filled(rows: np.ndarray, n: int) -> np.ndarray:
    """A copy of `(up to n, ...)` with zeros up to `(n, ...)`."""
    filled = np.zeros((n, *rows.shape[1:]))
    filled[: len(rows)] = rows
    return filled
