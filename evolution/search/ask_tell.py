"""Ask and tell, the protocol of all optimisers: misuse, NaN, state.

One generation is ``genomes = ask()``, an evaluation by the caller, ``tell(fitness)``.
An optimiser remembers what it asked and refuses every other order of calls. Its state
is defined between generations only, as plain arrays that ``np.savez`` writes and
``np.load(allow_pickle=False)`` reads. Fitness is maximised.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from evolution.search.lessons import Lessons


class AskTellError(RuntimeError):
    """An optimiser was called out of turn or told a fitness of the wrong shape."""


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
    """A read-only copy."""
    copy = np.array(array)
    copy.flags.writeable = False
    return copy


def generator_state(rng: Generator) -> np.ndarray:
    """The bit generator's state as JSON text in a unicode array `()`."""
    return np.array(json.dumps(rng.bit_generator.state, default=np.ndarray.tolist))


def restored_generator(rng: Generator, text: np.ndarray) -> Generator:
    """A generator of the kind of `rng` that continues where `text` was saved.

    Args:
        rng: left as it is; only its kind of bit generator is used.
        text: from `generator_state`, `()`.

    Raises:
        ValueError: `text` is not the state of such a bit generator.
    """
    bit_generator = type(rng.bit_generator)()
    try:
        bit_generator.state = json.loads(str(text))
    except (
        ValueError,
        TypeError,
        KeyError,
        OverflowError,
        RecursionError,
    ) as error:
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
        ValueError: another optimiser's state, a missing array, a wrong shape or type,
            or NaN.
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
        # a fitness may be infinite
        if got.dtype.kind == "f" and np.isnan(got).any():
            raise ValueError(f"state array {key!r}: expected numbers, got nan")
    return arrays


def part_of(state: Mapping[str, np.ndarray], name: str) -> dict[str, np.ndarray]:
    """The state of the optimiser of that name inside of another's state."""
    prefix = f"{name}."
    return {
        key.removeprefix(prefix): array
        for key, array in state.items()
        if key.startswith(prefix)
    }


class Optimizer(ABC):
    """A population-based maximiser that asks for fitness and is told.

    A subclass draws the first population when it is made. `propose` returns the genomes
    of each later generation, and `learn` updates the state with their fitness. State
    beside population, fitness and `rng` goes into `arrays` and is restored by `load`.
    `to_beat` says which fitness changes nothing; only racing needs it.

    Attributes:
        rng: the source of all its randomness.
        name: the algorithm's.
        population: genomes `(population, genes)` after the last tell, read-only; before
            the first tell the initial ones. As many as there are: it may grow.
        fitness: their stored fitness `(population,)`, read-only; -inf before the first
            tell.
        generation: number of tells so far.
    """

    growth = 1
    """Most that a generation costs, as a multiple of the costliest one before it."""

    needs_lessons = False
    """Whether it wants lessons, which only the paper's network can be given."""

    stores_means = False
    """Whether stored fitness may be the mean of several evaluations."""

    def __init__(self, name: str, population: np.ndarray, rng: Generator) -> None:
        """Begin with genomes `(population, genes)` that have not been evaluated."""
        self.rng = rng
        self._asked: np.ndarray | None = None
        self.name = name
        self.population = read_only(population)
        self.fitness = read_only(np.full(len(population), -np.inf))
        self.generation = 0

    @abstractmethod
    def propose(self) -> np.ndarray:
        """Genomes of the next generation `(n, genes)`; not called for the first."""

    @abstractmethod
    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Update the population and its fitness with the fitness told.

        Args:
            asked: its genomes `(n, genes)`; the first population in generation 0.
            told: their fitness `(n,)`, NaN made -inf.
        """

    def next_size(self) -> int:
        """Number of genomes that the next ask returns."""
        return len(self.population)

    def next_cost(self) -> int:
        """Number of evaluations that the next generation costs, with its lessons."""
        return self.next_size()

    def learn_in_life(self, lessons: Lessons) -> None:  # noqa: B027
        """Let genomes asked learn before they are evaluated; here, none does.

        Those that do are changed in what waits for its fitness, see `pending`.

        Args:
            lessons: that may cost `next_cost() - next_size()` evaluations.
        """

    def ask(self) -> np.ndarray:
        """Genomes to evaluate `(next_size(), genes)`, as a copy.

        Raises:
            AskTellError: the last genomes have not been told.
        """
        self._refuse_pending("ask")
        self._asked = self.propose() if self.generation else self.population
        return self._asked.copy()

    def to_beat(self) -> np.ndarray:
        """Fitness `(n,)` that each genome asked has to exceed to change anything.

        A genome that cannot may be told any fitness that does not exceed it either;
        -inf where every fitness matters, as it does if nothing else is said.

        Raises:
            AskTellError: nothing was asked.
        """
        return np.full(len(self.pending()), -np.inf)

    def tell(self, fitness: ArrayLike) -> None:
        """Accept the fitness `(n,)` of the genomes asked; NaN counts as -inf.

        Raises:
            AskTellError: nothing was asked, or another shape was expected; what was
                asked can still be told.
        """
        asked = self.pending()
        self.learn(asked, checked_fitness(fitness, len(asked)))
        self.generation += 1
        self._asked = None

    def begin_with(self, population: np.ndarray, fitness: np.ndarray) -> None:
        """Go on from individuals of another search, as if they had just been told.

        Args:
            population: genomes `(n, genes)`, as many as it has itself.
            fitness: theirs, `(n,)`.

        Raises:
            AskTellError: it has begun, or these are not as many.
        """
        self._refuse_pending("begin with others")
        if self.generation or population.shape != self.population.shape:
            raise AskTellError(
                f"expected {len(self.population)} individuals to begin with, before "
                f"the first generation, got {len(population)} in generation "
                f"{self.generation}"
            )
        self.learn(population.copy(), checked_fitness(fitness, len(population)))
        self.generation = 1

    def judge_anew(self, fitness: ArrayLike) -> None:
        """Replace the stored fitness of the population `(population,)`; NaN is -inf.

        For when what fitness means has changed: nothing of the old survives. An
        algorithm that keeps fitness elsewhere, too, replaces that as well.

        Raises:
            AskTellError: genomes asked have not been told, or another shape was
                expected.
        """
        self._refuse_pending("judge anew")
        self.fitness = read_only(checked_fitness(fitness, len(self.population)))

    def state(self) -> dict[str, np.ndarray]:
        """Everything the next generations depend on, as plain arrays.

        Raises:
            AskTellError: asked genomes have not been told.
        """
        self._refuse_pending("take the state")
        return self.arrays()

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue where `state` was taken, with the same random stream.

        Genomes asked but not told are forgotten. The optimiser must have been made with
        the parameters and the space of the one that was saved; of those, only what
        shows in names and shapes is checked.

        Raises:
            ValueError: not a state of this optimiser, which then stays as it was.
        """
        arrays = checked_state(state, like=self.arrays())
        rng = restored_generator(self.rng, arrays["generator"])
        self.load(arrays)
        self.rng = rng
        self.generation = int(arrays["generation"])
        self._asked = None

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Load the population, and the arrays that an algorithm adds to the state.

        The arrays have the shapes and types of `arrays`; whatever else can be wrong
        with them has to be found before anything is taken over.
        """
        self.population = read_only(arrays["population"])
        self.fitness = read_only(arrays["fitness"])

    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays of the state."""
        return {
            "name": np.array(self.name),
            "generation": np.array(self.generation),
            "population": self.population.copy(),
            "fitness": self.fitness.copy(),
            "generator": generator_state(self.rng),
        }

    def arrays_inside(self, name: str) -> dict[str, np.ndarray]:
        """Arrays of the state as part of another optimiser's; see `part_of`."""
        return {f"{name}.{key}": array for key, array in self.arrays().items()}

    def pending(self) -> np.ndarray:
        """The genomes `(n, genes)` that wait for their fitness.

        Raises:
            AskTellError: there are none.
        """
        if self._asked is None:
            raise AskTellError("nothing to tell: expected ask() first")
        return self._asked

    def replace_pending(self, genomes: np.ndarray) -> None:
        """Replace the genomes that wait for their fitness.

        Raises:
            AskTellError: there are none, or not as many.
        """
        if genomes.shape != self.pending().shape:
            raise AskTellError(
                f"expected genomes of shape {self.pending().shape}, got {genomes.shape}"
            )
        self._asked = read_only(genomes)

    def _refuse_pending(self, action: str) -> None:
        """Refuse an action while genomes wait for their fitness.

        Raises:
            AskTellError: they do; says what cannot be done.
        """
        if self._asked is not None:
            raise AskTellError(
                f"cannot {action}: expected tell() with {len(self._asked)} fitness "
                "values first"
            )
