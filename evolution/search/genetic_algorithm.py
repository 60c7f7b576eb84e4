"""A generational genetic algorithm on binary chromosomes, maximising.

Each gene is a fixed number of bits, plain binary or a Gray code, most significant
first. A new generation is bred from the one last told: tournaments choose the parents,
pairs of them are crossed at one point or at two, bits are flipped. Nothing survives by
itself unless `elites` is set. Randomness is drawn in this order: the initial bits, then
for each generation the tournaments, the crossover, the mutation.

Source:
    Sections 2 and 4 of the paper: population, crossover and mutation rates. Bits per
    gene, their coding, tournament size and the kind of crossover are this project's
    reading. The Gray code is the reflected one: F. Gray, US patent 2,632,058 (1953).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.limits import check
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.search_space import SearchSpace


def binary_of_gray(chromosomes: np.ndarray, bits: int) -> np.ndarray:
    """Chromosomes `(..., genes * bits)` in plain binary, of those in Gray code.

    A bit is set iff an odd number of bits of its gene are set in Gray code, up to and
    with its own.

    Args:
        chromosomes: `(..., genes * bits)` of bool, the most significant bit first.
        bits: per gene.
    """
    by_gene = chromosomes.reshape(*chromosomes.shape[:-1], -1, bits)
    binary = np.logical_xor.accumulate(by_gene, axis=-1)
    return binary.reshape(chromosomes.shape)


def decode(
    chromosomes: np.ndarray, bits: int, lower: float, upper: float
) -> np.ndarray:
    """Genomes `(..., genes)`, linear in the bits read as a number.

    Args:
        chromosomes: `(..., genes * bits)` of bool, the most significant bit first.
        bits: per gene.
        lower: what all zeros decode to.
        upper: what all ones decode to.
    """
    by_gene = chromosomes.reshape(*chromosomes.shape[:-1], -1, bits)
    levels = by_gene @ 2.0 ** np.arange(bits - 1, -1, -1)
    share = levels / (2**bits - 1)
    # In this form both ends are exact.
    return lower * (1 - share) + upper * share


def tournament_winners(
    fitness: np.ndarray, n_winners: int, size: int, rng: Generator
) -> np.ndarray:
    """Indices `(n_winners,)` of the best of `size` individuals each.

    Contestants are drawn uniformly with replacement; of equals the first drawn wins.

    Args:
        fitness: `(population,)`.
        n_winners: number of independent tournaments.
        size: contestants in each.
        rng: draws the contestants `(n_winners, size)`.
    """
    contestants = rng.integers(len(fitness), size=(n_winners, size))
    first = np.argmax(fitness[contestants], axis=1)
    return contestants[np.arange(n_winners), first]


def one_point_crossover(
    parents: np.ndarray, probability: float, rng: Generator
) -> np.ndarray:
    """Children `(2 * pairs, length)`: rows 2k and 2k + 1 with their tails exchanged.

    Args:
        parents: `(2 * pairs, length)` of bool, length at least 2.
        probability: that a pair is crossed at all.
        rng: draws the points `(pairs,)` in 1 to length - 1, then who is crossed
            `(pairs,)`.
    """
    n_pairs, length = len(parents) // 2, parents.shape[1]
    points = rng.integers(1, length, size=n_pairs)
    crossed = rng.random(n_pairs) < probability
    tail = np.arange(length) >= points[:, np.newaxis]
    return _exchanged(parents, tail & crossed[:, np.newaxis])


def two_point_crossover(
    parents: np.ndarray, probability: float, rng: Generator
) -> np.ndarray:
    """Children `(2 * pairs, length)`: rows 2k and 2k + 1 with their middles exchanged.

    The middle begins at one point and ends before the other; every two different points
    are equally likely.

    Args:
        parents: `(2 * pairs, length)` of bool, length at least 3.
        probability: that a pair is crossed at all.
        rng: draws a point `(pairs,)` in 1 to length - 1, the other `(pairs,)` among
            those that are left, then who is crossed `(pairs,)`.
    """
    n_pairs, length = len(parents) // 2, parents.shape[1]
    one = rng.integers(1, length, size=n_pairs)
    other = rng.integers(1, length - 1, size=n_pairs)
    other += other >= one
    crossed = rng.random(n_pairs) < probability
    begin, end = np.minimum(one, other), np.maximum(one, other)
    places = np.arange(length)
    middle = (places >= begin[:, np.newaxis]) & (places < end[:, np.newaxis])
    return _exchanged(parents, middle & crossed[:, np.newaxis])


def _exchanged(parents: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Children `(2 * pairs, length)` of pairs that exchange bits.

    Args:
        parents: `(2 * pairs, length)` of bool.
        where: the bits that are exchanged `(pairs, length)`.
    """
    first, second = parents[0::2], parents[1::2]
    children = np.empty_like(parents)
    children[0::2] = np.where(where, second, first)
    children[1::2] = np.where(where, first, second)
    return children


Crossover = Callable[[np.ndarray, float, Generator], np.ndarray]
# (parents (2 * pairs, length), probability, rng) -> children
CROSSOVERS: Mapping[int, Crossover] = {1: one_point_crossover, 2: two_point_crossover}


def mutate(chromosomes: np.ndarray, probability: float, rng: Generator) -> np.ndarray:
    """Chromosomes `(n, length)` in which each bit is flipped with `probability`."""
    return chromosomes ^ (rng.random(chromosomes.shape) < probability)


CODINGS = ("binary", "gray")
"""Codings of a gene's level in bits."""


@dataclass(frozen=True)
class GeneticAlgorithmParameters:
    """Parameters of a genetic algorithm.

    Attributes:
        population: number of individuals, at least 2; may be odd.
        bits: bits per gene, 1 to 32.
        tournament: number of individuals in each tournament.
        crossover: probability in [0, 1] that a pair of parents is crossed.
        mutation: probability in [0, 1] that a bit is flipped.
        elites: number of best individuals that enter the next generation unchanged.
            They are evaluated again, so an elite can lose its place by bad luck.
        coding: how a gene's level is written in bits: binary, or gray, in which
            neighbouring levels differ in one bit.
        crossover_points: 1 (tails are exchanged) or 2 (middles are exchanged).
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range or an unknown name.
    """

    population: int = 100
    bits: int = 8
    tournament: int = 5
    crossover: float = 0.85
    mutation: float = 0.01
    elites: int = 0
    coding: str = "binary"
    crossover_points: int = 1
    algorithm: Literal["genetic_algorithm"] = "genetic_algorithm"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        check("population", self.population, least=2)
        for name in ("bits", "tournament", "crossover", "mutation", "elites"):
            check(name, getattr(self, name))
        check("crossover_points", self.crossover_points)
        if self.coding not in CODINGS:
            raise ValueError(
                f"unknown coding {self.coding!r}; available: {', '.join(CODINGS)}"
            )
        if self.elites >= self.population:
            raise ValueError(
                f"elites: expected 0 to population - 1 = {self.population - 1}, "
                f"got {self.elites}"
            )


class GeneticAlgorithm(Optimizer):
    """The optimiser 'ga'.

    Its population are the individuals last told, good or bad.
    """

    def __init__(
        self,
        parameters: GeneticAlgorithmParameters,
        space: SearchSpace,
        rng: Generator,
    ) -> None:
        """Draw the initial bits; `rng` belongs to the optimiser from here on.

        Raises:
            ValueError: chromosomes with fewer bits than parts to cross, or a space
                whose initial range is not its bounds, which uniform bits cannot honour.
        """
        length = space.genes * parameters.bits
        least = parameters.crossover_points + 1
        if length < least:
            raise ValueError(
                f"expected chromosomes of at least {least} bits to cross, got {length}"
            )
        if (space.init_lower, space.init_upper) != (space.lower, space.upper):
            raise ValueError(
                f"ga begins with uniform bits: expected the initial range "
                f"[{space.lower}, {space.upper}] of its bounds, "
                f"got [{space.init_lower}, {space.init_upper}]"
            )
        self._parameters = parameters
        self._space = space
        shape = (parameters.population, length)
        self._chromosomes = rng.integers(2, size=shape).astype(bool)
        super().__init__("ga", self._decoded(self._chromosomes), rng)

    def propose(self) -> np.ndarray:
        """Offspring of the generation last told, after its elites."""
        # those of the population are of no more use
        self._chromosomes = self._offspring()
        return self._decoded(self._chromosomes)

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Make the generation asked the current one."""
        self.population, self.fitness = read_only(asked), read_only(told)

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        self._chromosomes = arrays["chromosomes"]
        self.population = read_only(self._decoded(self._chromosomes))
        self.fitness = read_only(arrays["fitness"])

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        arrays = super().arrays()
        # genomes are decoded from them
        del arrays["population"]
        return {**arrays, "chromosomes": self._chromosomes.copy()}

    def _decoded(self, chromosomes: np.ndarray) -> np.ndarray:
        bits, space = self._parameters.bits, self._space
        if self._parameters.coding == "gray":
            chromosomes = binary_of_gray(chromosomes, bits)
        return decode(chromosomes, bits, space.lower, space.upper)

    def _offspring(self) -> np.ndarray:
        """The next generation's chromosomes `(population, length)`, elites first."""
        parameters, rng = self._parameters, self.rng
        # Of equals the first is the better.
        best_first = np.argsort(-self.fitness, kind="stable")
        elites = self._chromosomes[best_first[: parameters.elites]]
        # Parents come in pairs; an odd last child is not used.
        n_children = parameters.population - parameters.elites
        n_parents = n_children + n_children % 2
        winners = tournament_winners(
            self.fitness, n_parents, parameters.tournament, rng
        )
        parents = self._chromosomes[winners]
        cross = CROSSOVERS[parameters.crossover_points]
        children = cross(parents, parameters.crossover, rng)
        children = mutate(children[:n_children], parameters.mutation, rng)
        return np.concatenate([elites, children])
