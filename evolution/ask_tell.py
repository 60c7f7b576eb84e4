"""The rules of ask and tell that every optimiser shares: space, misuse, NaN, state.

One generation is ``genomes = ask()``, an evaluation by the caller, ``tell(fitness)``.
An optimiser remembers what it asked and refuses every other order of calls. Its state
is defined between generations only, as plain arrays that ``np.savez`` writes and
``np.load(allow_pickle=False)`` reads. Fitness is maximised.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike


class AskTellError(RuntimeError):
    """An optimiser was called out of turn or told a fitness of the wrong shape."""


@dataclass(frozen=True)
class SearchSpace:
    """A box of genomes `(genes,)`, with the box in which the search begins.

    Attributes:
        genes: length of a genome.
        lower: smallest allowed value, the same for every gene.
        upper: largest allowed value, the same for every gene.
        init_lower: lower end of the initial uniform population.
        init_upper: upper end of the initial uniform population.

    Raises:
        ValueError: no genes, an empty or infinite box, or a beginning outside of it.
    """

    genes: int
    lower: float
    upper: float
    init_lower: float
    init_upper: float

    def __post_init__(self) -> None:
        """Refuse a box that cannot be searched."""
        if self.genes < 1:
            raise ValueError(f"expected at least 1 gene, got {self.genes}")
        if not -np.inf < self.lower < self.upper < np.inf:
            raise ValueError(
                f"expected finite bounds, lower < upper, got {self.lower}, {self.upper}"
            )
        if not self.lower <= self.init_lower <= self.init_upper <= self.upper:
            raise ValueError(
                f"expected an initial range inside [{self.lower}, {self.upper}], "
                f"got [{self.init_lower}, {self.init_upper}]"
            )


def refuse_pending(asked: np.ndarray | None, action: str) -> None:
    """Nothing, unless genomes wait for their fitness.

    Args:
        asked: what the last ask proposed, None if it has been told.
        action: what the caller is about to do, for the message.

    Raises:
        AskTellError: `asked` has not been told.
    """
    if asked is not None:
        raise AskTellError(
            f"cannot {action}: expected tell() with {len(asked)} fitness values first"
        )


def pending(asked: np.ndarray | None) -> np.ndarray:
    """The genomes or chromosomes `(n, ...)` that wait for their fitness.

    Raises:
        AskTellError: there are none.
    """
    if asked is None:
        raise AskTellError("nothing to tell: expected ask() first")
    return asked


def checked_fitness(fitness: ArrayLike, n_asked: int) -> np.ndarray:
    """Fitness `(n_asked,)`, a copy in which NaN is the worst there is, -inf.

    The only place in the package where NaN is given a meaning.

    Raises:
        AskTellError: the shape is not `(n_asked,)`.
    """
    values = np.asarray(fitness, dtype=np.float64)
    if values.shape != (n_asked,):
        raise AskTellError(
            f"expected fitness of shape ({n_asked},), one per genome asked, "
            f"got {values.shape}"
        )
    return np.where(np.isnan(values), -np.inf, values)


def read_only(array: np.ndarray) -> np.ndarray:
    """A copy that refuses to be written to."""
    copy = np.array(array)
    copy.flags.writeable = False
    return copy


def generator_state(rng: Generator) -> np.ndarray:
    """The bit generator's state as JSON text in a unicode array `()`."""
    return np.array(json.dumps(rng.bit_generator.state, default=np.ndarray.tolist))


def restored_generator(rng: Generator, text: np.ndarray) -> Generator:
    """A new generator of the kind of `rng` that goes on where `text` was saved.

    Args:
        rng: left as it is; only its kind of bit generator is used.
        text: from `generator_state`, `()`.

    Raises:
        ValueError: `text` is not the state of such a bit generator.
    """
    bit_generator = type(rng.bit_generator)()
    try:
        bit_generator.state = json.loads(str(text))
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise ValueError(
            f"expected the state of a {type(bit_generator).__name__} bit generator, "
            f"got {str(text)[:60]!r}"
        ) from error
    return Generator(bit_generator)


def checked_state(
    state: Mapping[str, np.ndarray], like: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Copies of the arrays of `state`, which agree with `like` in all but the values.

    Args:
        state: what was saved; `np.load` gives such a mapping.
        like: the state of the optimiser that is to be restored; holds 'name'.

    Raises:
        ValueError: another optimiser's state, a missing array, a wrong shape or type.
    """
    if "name" in state and str(state["name"]) != str(like["name"]):
        raise ValueError(
            f"expected a state of {str(like['name'])!r}, got {str(state['name'])!r}"
        )
    missing = [key for key in like if key not in state]
    if missing:
        raise ValueError(
            f"state lacks {', '.join(missing)}; expected {', '.join(like)}"
        )
    arrays = {key: np.array(state[key]) for key in like}
    for key, expected in like.items():
        got = arrays[key]
        if got.shape != expected.shape or got.dtype.type is not expected.dtype.type:
            raise ValueError(
                f"state array {key!r}: expected {expected.dtype} {expected.shape}, "
                f"got {got.dtype} {got.shape}"
            )
    return arrays


def refuse_wide_steps(sigma: float, space: SearchSpace) -> None:
    """Nothing, unless steps are wider than the bounds.

    Raises:
        ValueError: `sigma` exceeds their width.
    """
    width = space.upper - space.lower
    if sigma > width:
        raise ValueError(
            f"sigma: expected at most {width}, the width of the bounds, got {sigma}"
        )


class Survivors:
    """What optimisers share whose population are genomes with their stored fitness.

    The attributes are those of `Optimizer`.
    """

    def __init__(self, name: str, population: np.ndarray, rng: Generator) -> None:
        """Begin with genomes `(population, genes)` that have not been evaluated."""
        self._rng = rng
        self._asked: np.ndarray | None = None
        self.name = name
        self.population = read_only(population)
        self.fitness = read_only(np.full(len(population), -np.inf))
        self.generation = 0

    def state(self) -> dict[str, np.ndarray]:
        """Everything the next generations depend on; see `Optimizer.state`."""
        refuse_pending(self._asked, "take the state")
        return self._arrays()

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on where `state` was taken; see `Optimizer.restore`."""
        arrays = checked_state(state, like=self._arrays())
        self._rng = restored_generator(self._rng, arrays["generator"])
        self.population = read_only(arrays["population"])
        self.fitness = read_only(arrays["fitness"])
        self.generation = int(arrays["generation"])
        self._asked = None

    def _arrays(self) -> dict[str, np.ndarray]:
        return {
            "name": np.array(self.name),
            "generation": np.array(self.generation),
            "population": self.population.copy(),
            "fitness": self.fitness.copy(),
            "generator": generator_state(self._rng),
        }
