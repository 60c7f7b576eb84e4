"""OpenAI's evolution strategy, maximising: Adam along an estimated gradient.

A centre is moved. Each generation asks pairs of genomes that mirror one another at the
centre, at sigma times a standard normal vector, and the centre itself, so that it can
be the best individual. The genomes of the pairs are ranked, equals with their mean
rank, and the ranks are spread evenly over [-1/2, 1/2]. Half the difference of a pair's
ranks weighs its direction; the mean of the weighted directions is the gradient, which
Adam follows. The centre's own fitness does not count in it.

Genomes asked are clipped to the bounds, and so is the centre. The direction of a pair
is half of the difference of its clipped genomes, in units of sigma: the normal vector,
unless it was clipped.

The published strategy begins with small random weights. Here the first generation is
uniform in the initial range, as in the other algorithms, and its best genome is the
first centre. Randomness is drawn in this order: the first generation, then for each
generation the normal vectors.

Source:
    T. Salimans et al., Evolution strategies as a scalable alternative to reinforcement
    learning, arXiv:1703.03864; with mirrored samples, centred ranks, Adam and weight
    decay as in P. Pagliuca, N. Milano and S. Nolfi, Frontiers in Robotics and AI 7
    (2020) 98. Adam: D. Kingma and J. Ba, arXiv:1412.6980, algorithm 1. The division of
    the gradient by sigma is left out: Adam undoes every factor of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.limits import check
from evolution.search.adam import Adam
from evolution.search.ask_tell import Optimizer, read_only
from evolution.search.search_space import SearchSpace, refuse_wide_steps


def centred_ranks(fitness: np.ndarray) -> np.ndarray:
    """Ranks `(n,)` spread evenly from -1/2, the worst, to 1/2; equals share their mean.

    Args:
        fitness: `(n,)` without NaN, n at least 2.
    """
    ascending = np.sort(fitness)
    worse = np.searchsorted(ascending, fitness, side="left")
    not_better = np.searchsorted(ascending, fitness, side="right")
    return (worse + not_better - 1) / (2 * (len(fitness) - 1)) - 0.5


def estimated_gradient(
    plus: np.ndarray, minus: np.ndarray, ranks: np.ndarray, sigma: float
) -> np.ndarray:
    """Gradient `(genes,)` of the ranks, times sigma.

    Args:
        plus: one genome of each pair `(pairs, genes)`.
        minus: the other one `(pairs, genes)`.
        ranks: centred ranks `(2 * pairs,)`, of `plus` and then of `minus`.
        sigma: standard deviation of the genes.
    """
    directions = (plus - minus) / (2 * sigma)
    weights = (ranks[: len(plus)] - ranks[len(plus) :]) / 2
    return np.sum(weights[:, np.newaxis] * directions, axis=0) / len(plus)


@dataclass(frozen=True)
class OpenAiEsParameters:
    """Parameters of OpenAI's evolution strategy.

    Attributes:
        pairs: mirrored pairs of a generation, at least 1. A generation has
            2 pairs + 1 individuals.
        sigma: standard deviation of the samples around the centre, above 0, at most the
            width of the bounds.
        learning_rate: Adam's step size, above 0, at most the width of the bounds: the
            most that a gene of the centre usually moves in a generation.
        weight_decay: the gradient is reduced by this share of the centre's genes.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    pairs: int = 20
    sigma: float = 0.5
    learning_rate: float = 0.2
    weight_decay: float = 0.0
    algorithm: Literal["openai_es"] = "openai_es"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("pairs", "sigma", "learning_rate", "weight_decay"):
            check(name, getattr(self, name))


class OpenAiEs(Optimizer):
    """The optimiser 'openai-es'.

    Its population are the individuals last told, good or bad, the centre last.
    """

    def __init__(
        self,
        parameters: OpenAiEsParameters,
        space: SearchSpace,
        rng: Generator,
    ) -> None:
        """Draw the first genomes; `rng` belongs to the optimiser from here on.

        Raises:
            ValueError: samples or steps wider than the bounds.
        """
        refuse_wide_steps(parameters.sigma, space)
        refuse_wide_steps(parameters.learning_rate, space, "learning_rate")
        shape = (2 * parameters.pairs + 1, space.genes)
        first = rng.uniform(space.init_lower, space.init_upper, size=shape)
        super().__init__("openai-es", first, rng)
        self._parameters = parameters
        self._space = space
        self._centre = np.zeros(space.genes)
        self._adam = Adam((space.genes,))

    def propose(self) -> np.ndarray:
        """Pairs around the centre, and the centre `(2 * pairs + 1, genes)`."""
        parameters, centre = self._parameters, self._centre
        shape = (parameters.pairs, self._space.genes)
        steps = parameters.sigma * self.rng.standard_normal(shape)
        return self._clipped(np.vstack([centre + steps, centre - steps, centre]))

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Make the generation asked the current one; move the centre."""
        self.population, self.fitness = read_only(asked), read_only(told)
        if self.generation == 0:
            # On ties the first is the best.
            self._centre = asked[np.argmax(told)].copy()
            return
        parameters, pairs = self._parameters, self._parameters.pairs
        gradient = estimated_gradient(
            asked[:pairs],
            asked[pairs : 2 * pairs],
            centred_ranks(told[: 2 * pairs]),
            parameters.sigma,
        )
        gradient -= parameters.weight_decay * self._centre
        step = parameters.learning_rate * self._adam.step(gradient)
        self._centre = self._clipped(self._centre + step)

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.load`."""
        super().load(arrays)
        self._centre = arrays["centre"]
        self._adam.load(arrays)

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        return {
            **super().arrays(),
            "centre": self._centre.copy(),
            **self._adam.arrays(),
        }

    def _clipped(self, genomes: np.ndarray) -> np.ndarray:
        """Genomes `(..., genes)` with genes outside the bounds moved to these."""
        return np.clip(genomes, self._space.lower, self._space.upper)
