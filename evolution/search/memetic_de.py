"""Memetic DE: differential evolution whose accepted trials climb a few steps more.

After each generation of differential evolution come some of refinement: each individual
that was accepted there gets one candidate, itself plus normal noise on every gene, and
is replaced by it iff the candidate's fitness is strictly higher, as trials replace
their parents. Without accepted trials evolution goes on at once.

Source:
    P. Moscato, Caltech Concurrent Computation Program, report 826 (1989), for the idea;
    the kind of the local search is this project's choice.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.command_line import PART
from epuck_mj.host.limits import check
from evolution.search.around_evolution import AroundEvolution
from evolution.search.differential_evolution import DifferentialEvolutionParameters
from evolution.search.search_space import SearchSpace, refuse_wide_steps


@dataclass(frozen=True)
class MemeticDeParameters:
    """Parameters of memetic differential evolution.

    Attributes:
        evolution: parameters of the differential evolution.
        refinements: generations of refinement after each generation of evolution.
        sigma: standard deviation of a candidate's genes around the individual's.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    evolution: Annotated[DifferentialEvolutionParameters, PART]
    refinements: int = 3
    sigma: float = 0.3
    algorithm: Literal["memetic_de"] = "memetic_de"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        check("refinements", self.refinements)
        check("sigma", self.sigma)


class MemeticDe(AroundEvolution):
    """The optimiser 'memetic-de'."""

    def __init__(
        self, parameters: MemeticDeParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Draw the first population; `rng` belongs to the optimiser from here on.

        Raises:
            ValueError: steps wider than the bounds.
        """
        refuse_wide_steps(parameters.sigma, space)
        super().__init__("memetic-de", parameters.evolution, space, rng)
        self._parameters = parameters
        # generations of refinement that are left, and the individuals that are refined
        self._left = 0
        self._refined = np.zeros(len(self.population), dtype=bool)

    def next_size(self) -> int:
        """See `Optimizer.next_size`."""
        return int(self._refined.sum()) if self._left else super().next_size()

    def propose(self) -> np.ndarray:
        """Candidates of the individuals that are refined, or what evolution asks."""
        if not self._left:
            return super().propose()
        known = self.population[self._refined]
        candidates = known + self._parameters.sigma * self.rng.normal(size=known.shape)
        return np.clip(candidates, self._space.lower, self._space.upper)

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: a candidate that is not better is forgotten."""
        self.pending()
        return self.fitness[self._refined] if self._left else super().to_beat()

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Replace individuals by better candidates, or tell evolution."""
        if self._left:
            who = np.flatnonzero(self._refined)
            better = told > self.fitness[who]
            self.evolution.replace(who[better], asked[better], told[better])
            self.take_over()
            self._left -= 1
            return
        before = self.population
        super().learn(asked, told)
        # in the first generation no individual replaces another
        self._refined = (self.population != before).any(axis=1)
        self._left = self._parameters.refinements if self._refined.any() else 0

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        super().load(arrays)
        self._left, self._refined = int(arrays["left"]), arrays["refined"]

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        own = {"left": np.array(self._left), "refined": self._refined.copy()}
        return {**super().arrays(), **own}
