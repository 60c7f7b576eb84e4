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
from numpy.typing import ArrayLike

from epuck_mj.host.command_line import PART
from epuck_mj.host.limits import check
from evolution.search.ask_tell import (
    Optimizer,
    checked_state,
    generator_state,
    part_of,
    restored_generator,
)
from evolution.search.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionParameters,
)
from evolution.search.search_space import SearchSpace, refuse_wide_steps


@dataclass(frozen=True)
class MemeticDeParameters:
    """Parameters of memetic differential evolution.

    Attributes:
        evolution: parameters of the differential evolution.
        refinements: generations of refinement after each of evolution.
        sigma: standard deviation of a candidate's genes around the individual's.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    evolution: Annotated[DifferentialEvolutionParameters, PART]
    refinements: int = 3
    sigma: float = 0.3
    algorithm: Literal["memetic_de"] = "memetic_de"
    # read by the configuration: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        check("refinements", self.refinements)
        check("sigma", self.sigma)


class MemeticDe(Optimizer):
    """The optimiser 'memetic-de'.

    Attributes:
        evolution: whose population and fitness are its own.
    """

    def __init__(
        self, parameters: MemeticDeParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Draw the first population; `rng` belongs to the optimiser from here on.

        Raises:
            ValueError: steps wider than the bounds.
        """
        refuse_wide_steps(parameters.sigma, space)
        # the same first population as without
        self.evolution = DifferentialEvolution(parameters.evolution, space, rng)
        (own,) = rng.spawn(1)
        super().__init__("memetic-de", self.evolution.population, own)
        self._parameters = parameters
        self._space = space
        # generations of refinement to come, and who is refined
        self._left = 0
        self._refined = np.zeros(len(self.population), dtype=bool)

    def next_size(self) -> int:
        """See `Optimizer.next_size`."""
        if self._left:
            return int(self._refined.sum())
        return self.evolution.next_size()

    def propose(self) -> np.ndarray:
        """Candidates of those who are refined, or what evolution asks."""
        if not self._left:
            return self.evolution.ask()
        known = self.population[self._refined]
        candidates = known + self._parameters.sigma * self.rng.normal(size=known.shape)
        return np.clip(candidates, self._space.lower, self._space.upper)

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: a candidate that is not better is forgotten."""
        if self.generation == 0:
            return super().to_beat()
        self.pending()
        if self._left:
            return self.fitness[self._refined].copy()
        return self.evolution.to_beat()

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Replace those whose candidates are better, or tell evolution."""
        if self._left:
            who = np.flatnonzero(self._refined)
            better = told > self.fitness[who]
            self.evolution.replace(who[better], asked[better], told[better])
            self._left -= 1
        else:
            before = self.population
            if self.generation == 0:
                self.evolution.ask()
            self.evolution.tell(told)
            # in the first generation nobody is accepted in place of another
            self._refined = (self.evolution.population != before).any(axis=1)
            self._left = self._parameters.refinements if self._refined.any() else 0
        self._take_over()

    def _take_over(self) -> None:
        self.population = self.evolution.population
        self.fitness = self.evolution.fitness

    def judge_anew(self, fitness: ArrayLike) -> None:
        """See `Optimizer.judge_anew`."""
        self._refuse_pending("judge anew")
        self.evolution.judge_anew(fitness)
        self._take_over()

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.restore`."""
        arrays = checked_state(state, like=self.arrays())
        rng = restored_generator(self.rng, arrays["generator"])
        self.evolution.restore(part_of(arrays, "evolution"))
        self.rng = rng
        self.generation = int(arrays["generation"])
        self._left, self._refined = int(arrays["left"]), arrays["refined"]
        self._asked = None
        self._take_over()

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        return {
            "name": np.array(self.name),
            "generation": np.array(self.generation),
            "generator": generator_state(self.rng),
            "left": np.array(self._left),
            "refined": self._refined.copy(),
            **self.evolution.arrays_inside("evolution"),
        }
