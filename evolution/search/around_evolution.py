"""Hybrids around a differential evolution, whose population is their own."""

from collections.abc import Mapping

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from evolution.search.ask_tell import Optimizer, generator_state, part_of
from evolution.search.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionParameters,
)
from evolution.search.search_space import SearchSpace


class AroundEvolution(Optimizer):
    """An optimiser that asks what a differential evolution asks, and more.

    Attributes:
        evolution: whose population and fitness are its own.
    """

    def __init__(
        self,
        name: str,
        parameters: DifferentialEvolutionParameters,
        space: SearchSpace,
        rng: Generator,
    ) -> None:
        """Draw the first population: the same as without the hybrid."""
        self.evolution = DifferentialEvolution(parameters, space, rng)
        (own,) = rng.spawn(1)
        super().__init__(name, self.evolution.population, own)
        self.stores_means = self.evolution.stores_means
        self._space = space

    def next_size(self) -> int:
        """See `Optimizer.next_size`: what evolution says."""
        return self.evolution.next_size()

    def propose(self) -> np.ndarray:
        """What evolution asks."""
        return self.evolution.ask()

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`: what evolution says."""
        if self.generation == 0:
            return super().to_beat()
        self.pending()
        return self.evolution.to_beat()

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Tell evolution."""
        if self.generation == 0:
            # it was not asked: its first population is known
            self.evolution.ask()
        self.evolution.tell(told)
        self.take_over()

    def take_over(self) -> None:
        """Make evolution's population and fitness its own."""
        self.population = self.evolution.population
        self.fitness = self.evolution.fitness

    def judge_anew(self, fitness: ArrayLike) -> None:
        """See `Optimizer.judge_anew`."""
        self._refuse_pending("judge anew")
        self.evolution.judge_anew(fitness)
        self.take_over()

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        self.evolution.restore(part_of(arrays, "evolution"))
        self.take_over()

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        return {
            "name": np.array(self.name),
            "generation": np.array(self.generation),
            "generator": generator_state(self.rng),
            **self.evolution.arrays_inside("evolution"),
        }
