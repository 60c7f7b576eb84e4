"""CMA-ES with restarts, maximising: the package `cmaes` behind ask and tell.

Each search is a `cmaes.CMA` that starts at a random mean in the initial range. When it
has converged, which `cmaes` detects, or when it only follows noise, which
`has_stagnated` detects, the next generation starts another one with twice the
population. A genome outside the bounds is drawn again up to 100 times, then clipped, by
`cmaes`.

A `cmaes.CMA` cannot be saved without pickle or its private attributes. But it is a
function of its seed and of what it was told: that is the state, and it is restored by
asking and telling everything again. Randomness is drawn in this order: for each start
the mean, then the seed of `cmaes`, which has a bit generator of its own. Samples are
those of `SymmetricCma`.

Source:
    N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772; restarts:
    A. Auger and N. Hansen, IEEE Congress on Evolutionary Computation (2005) 1769-1776;
    learning rates that adapt: M. Nomura, Y. Akimoto and I. Ono, CMA-ES with Learning
    Rate Adaptation, arXiv:2304.03473.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.limits import check
from evolution.search.ask_tell import (
    AskTellError,
    Optimizer,
    checked_state,
    generator_state,
    read_only,
    restored_generator,
)
from evolution.search.random_search import best_of
from evolution.search.search_space import SearchSpace, refuse_wide_steps

if TYPE_CHECKING:
    from cmaes import CMA

# With a single parent, half of 3, `cmaes` divides by a learning rate of 0.
MIN_POPULATION = 4

ELITES = 10
"""Individuals of another search whose spread is a search's first step. Chosen."""

LEAST_STEP = 0.05
"""Least first step size there. Chosen: 0.5 % of the paper's bounds."""

GROWTH = 2
"""Factor by which a restart increases the number of individuals."""


def made_finite(fitness: np.ndarray) -> np.ndarray:
    """Fitness `(n,)` in the same order, without infinities.

    The infinite ones come just behind the worst finite one, or just before the best: a
    `cmaes.CMA` uses the order, and the range only to see that it has become nothing.

    Args:
        fitness: `(n,)` without NaN.
    """
    finite = fitness[np.isfinite(fitness)]
    worst, best = (finite.min(), finite.max()) if len(finite) else (0.0, 0.0)
    return np.clip(fitness, np.nextafter(worst, -np.inf), np.nextafter(best, np.inf))


@dataclass(frozen=True)
class CmaEsParameters:
    """Parameters of a CMA-ES.

    Attributes:
        population: individuals of a generation (lambda), at least 4; doubled by each
            restart. The tutorial's default for 40 genes is 15.
        sigma: first step size of each start, above 0, at most the width of the bounds.
        restarts: start again when there is no more progress; otherwise continue.
        learning_rate_adaptation: learn more slowly the less of each change is more than
            noise (LRA-CMA-ES). It takes the place of a larger population, so set
            restarts to false.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    population: int = 15
    sigma: float = 2.0
    restarts: bool = True
    learning_rate_adaptation: bool = False
    algorithm: Literal["cma_es"] = "cma_es"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        check("population", self.population, least=MIN_POPULATION)
        check("sigma", self.sigma)


class CmaEs(Optimizer):
    """The optimiser 'cma-es', or 'lra-cma-es' if its learning rates adapt.

    Its population are the individuals last told, good or bad; it grows at a restart.
    """

    def __init__(
        self, parameters: CmaEsParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Draw the first genomes; `rng` belongs to the optimiser from here on.

        Raises:
            ValueError: steps wider than the bounds.
        """
        refuse_wide_steps(parameters.sigma, space)
        self._parameters = parameters
        self._space = space
        self.growth = GROWTH if parameters.restarts else 1
        self.rng = rng
        # What the whole search follows from, together with what will be told.
        self._birth = generator_state(rng)
        self._elite: tuple[np.ndarray, float] | None = None
        self._told = [np.empty(0)]
        self._cma = self._started(parameters.population)
        name = "lra-cma-es" if parameters.learning_rate_adaptation else "cma-es"
        super().__init__(name, self.propose(), rng)

    def next_size(self) -> int:
        """See `Optimizer.next_size`."""
        return self._cma.population_size

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Make the generation asked the current one; restart without progress."""
        # the package minimises
        costs = (-made_finite(told)).tolist()
        self._cma.tell(list(zip(asked, costs, strict=True)))
        self._told.append(told)
        self._history.append((told.max(), np.sort(told)[len(told) // 2]))
        if self._parameters.restarts and self._should_stop():
            self._cma = self._started(GROWTH * self._cma.population_size)
        self.population, self.fitness = read_only(asked), read_only(told)

    def begin_with(self, population: np.ndarray, fitness: np.ndarray) -> None:
        """Start at the best of another search, of any size, with its elite's spread.

        The first step size is the standard deviation of the genes of its best `ELITES`
        individuals, `LEAST_STEP` at least and `sigma` at most. Nothing is as if told:
        the first generation is its own.

        Raises:
            AskTellError: it has begun.
        """
        if self.generation:
            raise AskTellError("cannot begin with others: it has begun")
        spread = float(population[best_of(fitness, ELITES)].std(axis=0).mean())
        sigma = min(max(spread, LEAST_STEP), self._parameters.sigma)
        self._begin_at(population[np.argmax(fitness)], sigma)

    def _begin_at(self, mean: np.ndarray, sigma: float) -> None:
        """Replace the first search, which has told nothing, by one from there."""
        self._elite = read_only(mean), sigma
        self.rng = restored_generator(self.rng, self._birth)
        self._cma = self._started(self._parameters.population, self._elite)
        self._asked = None
        self.population = read_only(self.propose())

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.restore`.

        Takes as long as all asks and tells up to there. What was told must also fill
        whole generations, and as many as there were.
        """
        # As long as it is; all the rest is as in any other state.
        n_told = np.size(state["told"]) if "told" in state else 0
        like = {**self.arrays(), "told": np.empty(n_told)}
        if "mean" in state and "sigma" in state:
            like |= {"mean": np.empty(self._space.genes), "sigma": np.array(0.0)}
        arrays = checked_state(state, like=like)
        rng = restored_generator(self.rng, arrays["generator"])
        replayed = CmaEs(self._parameters, self._space, rng)
        if "mean" in arrays:
            replayed._begin_at(arrays["mean"], float(arrays["sigma"]))
        told, generations = arrays["told"], int(arrays["generation"])
        while len(told) >= replayed.next_size():
            n = replayed.next_size()
            replayed.ask()
            replayed.tell(told[:n])
            told = told[n:]
        if len(told) or replayed.generation != generations:
            raise ValueError(
                f"state array 'told': expected the fitness of {generations} "
                f"generations, got {n_told} values, of {replayed.generation} "
                f"generations and {len(told)} more individuals"
            )
        # All of it: another search has begun and come as far as this.
        vars(self).update(vars(replayed))

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        elite = {}
        if self._elite is not None:
            elite = {"mean": self._elite[0].copy(), "sigma": np.array(self._elite[1])}
        return elite | {
            "name": np.array(self.name),
            "generation": np.array(self.generation),
            "told": np.concatenate(self._told),
            "generator": self._birth.copy(),
        }

    def _should_stop(self) -> bool:
        """Whether the present search makes no more progress, or only by noise."""
        window = stagnation_window(
            len(self._history), self._space.genes, self._cma.population_size
        )
        # not the whole of it: it is made an array in every generation
        recent = np.array(self._history[-window:])
        return self._cma.should_stop() or has_stagnated(recent, window)

    def _started(
        self, population: int, elite: tuple[np.ndarray, float] | None = None
    ) -> "CMA":
        """A new search with this population, at a random mean if at no elite's."""
        # it imports scipy, which is slow
        from evolution.search.symmetric_cma import SymmetricCma

        # fitness of the best and of the median individual of each of its generations
        self._history: list[tuple[float, float]] = []
        space, sigma = self._space, self._parameters.sigma
        mean = self.rng.uniform(space.init_lower, space.init_upper, size=space.genes)
        if elite is not None:
            mean, sigma = elite
        return SymmetricCma(
            mean=np.array(mean),
            sigma=sigma,
            bounds=np.tile([space.lower, space.upper], (space.genes, 1)),
            seed=int(self.rng.integers(2**32)),
            population_size=population,
            lr_adapt=self._parameters.learning_rate_adaptation,
        )

    def propose(self) -> np.ndarray:
        """The next genomes of the present search `(next_size(), genes)`."""
        return np.array([self._cma.ask() for _ in range(self.next_size())])


def stagnation_window(generations: int, genes: int, population: int) -> int:
    """Number of last generations that are checked for progress: a fifth, at least 120.

    Args:
        generations: how many there were since the start.
        genes: of a genome.
        population: individuals of a generation.
    """
    at_least = 120 + 30 * genes / population
    return int(np.clip(0.2 * generations, at_least, 20000))


def has_stagnated(history: np.ndarray, window: int) -> bool:
    """Whether fitness has not risen in the last `window` generations.

    Of none of the columns the median of the last 30 % is above that of the first 30 %.
    While there are fewer generations than that, there is no saying: False. Criteria
    about the range of fitness or the size of steps do not see it, since noise keeps
    both wide.

    Args:
        history: fitness `(generations, columns)` without NaN.
        window: at least 4.

    Source: the tutorial, appendix B.3, Stagnation.
    """
    if len(history) < window:
        return False
    part = int(0.3 * window)
    # the upper median: infinities have no mean
    first, last = (
        np.sort(values, axis=0)[part // 2]
        for values in (history[-window:][:part], history[-part:])
    )
    return bool(np.all(last <= first))
