"""(1+1) evolution strategies with the one-fifth success rule, maximising.

Several run independently side by side: each lineage is one parent with its own step
size sigma. In every generation it gets one offspring, the parent plus sigma times a
standard normal vector, and is replaced iff that is strictly fitter. A tie keeps the
parent and counts as a failure. Randomness is drawn in this order: the initial
population, then for each generation the normal vectors, the bounds rule.

Where fitness is noisy, parents have to be evaluated again with their offspring, on the
same trials. Otherwise a parent that was lucky once is never replaced, and every failure
makes its steps smaller: they end at `SIGMA_MIN`, far from any optimum.

Source:
    I. Rechenberg, Evolutionsstrategie (1973), for the rule; in the form for a single
    offspring of S. Kern et al., Natural Computing 3 (2004) 77-112: sigma times alpha
    after a success, times alpha**(-1/4) after a failure, so that it stays where one
    offspring in five is a success. alpha = exp(1/3) is what A. Auger and N. Hansen use
    in their tutorials. An offspring outside the bounds: see `bounds.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.limits import check
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.bounds import BOUNDS_RULES, check_bounds_rule
from evolution.search.search_space import SearchSpace, refuse_wide_steps

ALPHA = np.exp(1 / 3)
"""Factor of sigma after a success, which four failures undo."""

SIGMA_MIN = 1e-12
"""Smallest sigma, as a share of the width of the bounds; the rule itself has none."""


def one_fifth_rule(
    sigma: np.ndarray, success: np.ndarray, lower: float, upper: float
) -> np.ndarray:
    """The next sigma `(lineages,)`, between `SIGMA_MIN` and 1 width of the bounds.

    Args:
        sigma: step sizes `(lineages,)`.
        success: whether the offspring replaced its parent `(lineages,)`.
        lower: smallest allowed value of a gene.
        upper: largest allowed value of a gene.
    """
    width = upper - lower
    adapted = sigma * np.where(success, ALPHA, ALPHA**-0.25)
    return np.clip(adapted, SIGMA_MIN * width, width)


@dataclass(frozen=True)
class EvolutionStrategyParameters:
    """Parameters of (1+1) evolution strategies.

    Attributes:
        lineages: number of strategies side by side, at least 1: the population.
        sigma: first step size of each, above 0, at most the width of the bounds.
        bounds_rule: how a gene outside the bounds is moved: midpoint, none, clip,
            reflect or reinit.
        reevaluate_parents: from the second generation on, evaluate parents and
            offspring together, and compare and store their new fitness only. A
            generation then costs 2 evaluations for each lineage.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range or an unknown name.
    """

    lineages: int = 10
    sigma: float = 1.0
    bounds_rule: str = "reflect"
    reevaluate_parents: bool = True
    algorithm: Literal["evolution_strategy"] = "evolution_strategy"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        check("lineages", self.lineages)
        check("sigma", self.sigma)
        check_bounds_rule(self.bounds_rule)


class EvolutionStrategy(Optimizer):
    """The optimiser 'one-plus-one-es'.

    Its population are the parents. Without `reevaluate_parents` their stored fitness is
    for ever the one that let them in.
    """

    def __init__(
        self,
        parameters: EvolutionStrategyParameters,
        space: SearchSpace,
        rng: Generator,
    ) -> None:
        """Draw the first parents; `rng` belongs to the optimiser from here on.

        Raises:
            ValueError: steps wider than the bounds.
        """
        refuse_wide_steps(parameters.sigma, space)
        shape = (parameters.lineages, space.genes)
        population = rng.uniform(space.init_lower, space.init_upper, size=shape)
        super().__init__("one-plus-one-es", population, rng)
        self._parameters = parameters
        self._space = space
        self._sigma = np.full(parameters.lineages, parameters.sigma, dtype=np.float64)

    def next_size(self) -> int:
        """See `Optimizer.next_size`."""
        return len(self.population) * (2 if self._reevaluates() else 1)

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: the parents' fitness, which at first is -inf.

        Any other offspring is a failure, and by how much is forgotten. Without a limit
        where parents are re-evaluated, which changes what is to be beaten.
        """
        asked = self.pending()
        if self._reevaluates():
            return np.full(len(asked), -np.inf)
        return self.fitness.copy()

    def _reevaluates(self) -> bool:
        """Whether this generation asks parents and offspring together."""
        return self._parameters.reevaluate_parents and self.generation > 0

    def propose(self) -> np.ndarray:
        """One offspring of each parent, after the parents if those are re-evaluated."""
        parents, space, rng = self.population, self._space, self.rng
        steps = rng.standard_normal(parents.shape)
        offspring = parents + self._sigma[:, np.newaxis] * steps
        keep_inside = BOUNDS_RULES[self._parameters.bounds_rule]
        offspring = keep_inside(offspring, parents, space.lower, space.upper, rng)
        if self._reevaluates():
            return np.concatenate([parents, offspring])
        return offspring

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Let offspring replace their parents if strictly better; adapt sigma."""
        if self.generation == 0:
            self.fitness = read_only(told)
            return
        n = len(self.population)
        parent_fitness = told[:n] if self._reevaluates() else self.fitness
        offspring, offspring_fitness = asked[-n:], told[-n:]
        success = offspring_fitness > parent_fitness
        self.population = read_only(
            np.where(success[:, np.newaxis], offspring, self.population)
        )
        self.fitness = read_only(np.where(success, offspring_fitness, parent_fitness))
        lower, upper = self._space.lower, self._space.upper
        self._sigma = one_fifth_rule(self._sigma, success, lower, upper)

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        super().load(arrays)
        self._sigma = arrays["sigma"]

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        return {**super().arrays(), "sigma": self._sigma.copy()}
