"""Properties that every optimiser has to have, and a function that checks them.

    check_optimizer("my.py:Swarm")

The runs of a study can be interrupted, resumed, raced and compared because of these.
"""

import io
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from epuck_mj.errors import UserError
from evolution.search.ask_tell import AskTellError, Optimizer
from evolution.search.search_space import SearchSpace
from evolution.search.table import make_optimizer, parameters_kind

CUBE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-5, init_upper=5)
LOPSIDED = SearchSpace(genes=3, lower=-0.5, upper=1.5, init_lower=-0.5, init_upper=1.5)

Fitness = Callable[[np.ndarray], np.ndarray]


class Make:
    """Makes optimisers of one kind, each at generation 0."""

    def __init__(self, parameters: Any):
        """Name the parameters of the kind."""
        self._parameters = parameters

    def __call__(self, seed: int = 0, space: SearchSpace = CUBE) -> Optimizer:
        """An optimiser that searches `space`."""
        return make_optimizer(self._parameters, space, np.random.default_rng(seed))


Property = Callable[[Make], None]


def check_optimizer(algorithm: str, **parameters: Any) -> None:
    """Refuse an optimiser that lacks one of the properties.

    Args:
        algorithm: `my.py:Class`, or a shipped one.
        parameters: those that differ from its defaults.

    Raises:
        UserError: naming the first property that it lacks.
    """
    make = Make(parameters_kind(algorithm)(**parameters))
    for name, holds in PROPERTIES.items():
        try:
            holds(make)
        except Exception as error:
            why = " ".join(f"{type(error).__name__} {error}".split())
            raise UserError(
                f"optimiser '{algorithm}': this does not hold: {name} ({why})"
            ) from None


def sphere(genomes: np.ndarray) -> np.ndarray:
    """A fitness `(...)` whose best, 0, is at the origin."""
    return -np.sum(genomes**2, axis=-1)


def evolved(optimizer: Optimizer, generations: int, fitness: Fitness = sphere):
    """The optimiser itself, after a number of generations."""
    for _ in range(generations):
        optimizer.tell(fitness(optimizer.ask()))
    return optimizer


def require(condition: object, otherwise: str) -> None:
    """Refuse a condition that does not hold.

    Raises:
        AssertionError: with the text `otherwise`.
    """
    if not condition:
        raise AssertionError(otherwise)


def refused(kind: type[Exception], words: str, call: Callable[..., Any], *given: Any):
    """Require that a call raises an error of this kind with these words.

    Raises:
        AssertionError: if the call succeeds, or the words are others.
    """
    try:
        call(*given)
    except kind as error:
        require(words in str(error), f"expected '{words}' in '{error}'")
    else:
        raise AssertionError(f"expected {kind.__name__} with '{words}'")


def same(a: Optimizer, b: Optimizer) -> None:
    """Require that two are equal in every array, and in what they ask next."""
    left, right = a.state(), b.state()
    require(left.keys() == right.keys(), "the states have other names")
    for key in left:
        np.testing.assert_array_equal(left[key], right[key], err_msg=key)
    np.testing.assert_array_equal(a.population, b.population)
    np.testing.assert_array_equal(a.ask(), b.ask())


def saved_and_loaded(state: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A state as it comes back from a file."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **state)
    file.seek(0)
    with np.load(file, allow_pickle=False) as arrays:
        return dict(arrays)


def _bounds(make: Make) -> None:
    for space in (CUBE, LOPSIDED):
        optimizer = make(space=space)
        for _ in range(30):
            genomes = optimizer.ask()
            require(genomes.min() >= space.lower, "a gene is below its bound")
            require(genomes.max() <= space.upper, "a gene is above its bound")
            # the best is a corner
            optimizer.tell(genomes @ [1.0, -1.0, 1.0])


def _first_genomes(make: Make) -> None:
    # of several seeds, since ten individuals may miss an end
    genomes = np.concatenate([make(seed).ask() for seed in range(10)])
    require((genomes.min(axis=0) < -4.5).all(), "the lower end is empty")
    require((genomes.max(axis=0) > 4.5).all(), "the upper end is empty")


def _shapes(make: Make) -> None:
    optimizer = make()
    require((optimizer.fitness == -np.inf).all(), "a fitness before the first tell")
    for generation in range(4):
        require(optimizer.generation == generation, "the generation is not counted")
        n, genes = optimizer.population.shape
        require(genes == 3 and optimizer.fitness.shape == (n,), "another shape")
        expected = optimizer.next_size()
        genomes = optimizer.ask()
        require(genomes.shape == (expected, 3), "next_size is not what ask gives")
        require(genomes.dtype == np.float64, "genomes are no floats")
        require(optimizer.next_size() == expected, "next_size changed with ask")
        optimizer.tell(sphere(genomes))


def _stored(make: Make) -> None:
    optimizer = make()
    genomes = optimizer.ask()
    np.testing.assert_array_equal(genomes, optimizer.population)
    optimizer.tell(sphere(genomes))
    np.testing.assert_array_equal(genomes, optimizer.population)
    evolved(optimizer, 6)
    np.testing.assert_array_equal(optimizer.fitness, sphere(optimizer.population))


def _deterministic(make: Make) -> None:
    same(evolved(make(), 10), evolved(make(), 10))
    other = np.array_equal(make(1).ask(), make(2).ask())
    require(not other, "another seed asks the same")


def _arrays_are_not_shared(make: Make) -> None:
    careless, careful = make(), make()
    for _ in range(5):
        genomes = careless.ask()
        fitness = sphere(genomes)
        genomes[:] = 99
        careless.tell(fitness)
        fitness[:] = 99
        for array in careless.state().values():
            array[...] = array.dtype.type(0)
    same(careless, evolved(careful, 5))
    for optimizer in (make(), evolved(make(), 2)):
        for array in (optimizer.population, optimizer.fitness):
            refused(ValueError, "read-only", array.__setitem__, 0, 0)


def _resumes(make: Make) -> None:
    for before in (0, 1, 5):
        resumed = make(seed=123)
        resumed.restore(saved_and_loaded(evolved(make(), before).state()))
        require(resumed.generation == before, "the generation is another")
        same(evolved(resumed, 10 - before), evolved(make(), 10))


def _restored_is_its_own(make: Make) -> None:
    state, resumed = evolved(make(), 3).state(), make()
    # what was asked is forgotten
    resumed.ask()
    resumed.restore(state)
    for array in state.values():
        array[...] = array.dtype.type(0)
    same(resumed, evolved(make(), 3))


def _to_beat(make: Make) -> None:
    optimizer = make()
    for generation in range(4):
        refused(AskTellError, "expected ask() first", optimizer.to_beat)
        genomes = optimizer.ask()
        to_beat = optimizer.to_beat()
        require(to_beat.shape == (len(genomes),), "not one value a genome")
        require(not np.isnan(to_beat).any(), "NaN is to beat")
        require(generation or (to_beat == -np.inf).all(), "something at first")
        # the caller may keep the array
        to_beat[:] = 99
        optimizer.tell(sphere(genomes))
    same(optimizer, evolved(make(), 4))


def _races(make: Make) -> None:
    def plateaus(genomes: np.ndarray) -> np.ndarray:
        # many get exactly the fitness that they have to beat
        return np.round(sphere(genomes) / 4)

    for fitness in (sphere, plateaus):
        honest, raced = make(), make()
        for _ in range(15):
            evolved(honest, 1, fitness)
            told = fitness(raced.ask())
            raced.tell(np.where(told <= raced.to_beat(), -1e9, told))
            np.testing.assert_array_equal(raced.population, honest.population)
            np.testing.assert_array_equal(raced.fitness, honest.fitness)
        same(raced, honest)


def _turns(make: Make) -> None:
    optimizer, first = make(), "nothing to tell: expected ask() first"
    refused(AskTellError, first, optimizer.tell, np.zeros(optimizer.next_size()))
    genomes = optimizer.ask()
    waiting = f"expected tell() with {len(genomes)} "
    refused(AskTellError, waiting, optimizer.ask)
    refused(AskTellError, "cannot take the state", optimizer.state)
    fitness = sphere(genomes)
    for wrong in (1.0, fitness[:-1], fitness[:, np.newaxis], np.append(fitness, 0)):
        refused(AskTellError, f"({len(genomes)},)", optimizer.tell, wrong)
    optimizer.tell(fitness)
    refused(AskTellError, first, optimizer.tell, fitness)
    same(optimizer, evolved(make(), 1))


def _bad_states(make: Make) -> None:
    optimizer, good = evolved(make(), 3), evolved(make(seed=9), 5).state()
    for key in good:
        lacking = {k: v for k, v in good.items() if k != key}
        refused(ValueError, f"state lacks {key}; expected ", optimizer.restore, lacking)
        twice, other = np.stack([good[key]] * 2), np.zeros(good[key].shape, complex)
        refused(ValueError, "expected", optimizer.restore, {**good, key: twice})
        refused(ValueError, "expected", optimizer.restore, {**good, key: other})
    broken = {**good, "generator": np.array("{}")}
    refused(ValueError, "expected the state of a PCG64", optimizer.restore, broken)
    foreign = {**good, "name": np.array("of nobody")}
    refused(ValueError, "got 'of nobody'", optimizer.restore, foreign)
    same(optimizer, evolved(make(), 3))


def _nan(make: Make) -> None:
    def holed(genomes: np.ndarray) -> np.ndarray:
        return np.where(genomes[:, 0] > 0, np.nan, sphere(genomes))

    optimizer = make()
    genomes = optimizer.ask()
    optimizer.tell(holed(genomes))
    np.testing.assert_array_equal(optimizer.fitness == -np.inf, genomes[:, 0] > 0)
    for _ in range(60):
        evolved(optimizer, 1, holed)
        require(not np.isnan(optimizer.fitness).any(), "NaN is stored")
    best = optimizer.population[np.argmax(optimizer.fitness)]
    require(best[0] <= 0, "the best has no fitness")


def _only_the_worst(make: Make) -> None:
    optimizer = evolved(make(), 5, lambda genomes: np.full(len(genomes), -np.inf))
    require((optimizer.fitness == -np.inf).all(), "a fitness that nobody told")
    require(np.isfinite(optimizer.population).all(), "genes that are no numbers")
    evolved(optimizer, 20)
    require(np.isfinite(optimizer.fitness).any(), "it does not go on")


PROPERTIES: Mapping[str, Property] = MappingProxyType(
    {
        "bounds are obeyed": _bounds,
        "the first genomes fill the initial range": _first_genomes,
        "shapes and sizes are as announced": _shapes,
        "stored fitness belongs to the stored genomes": _stored,
        "the seed decides": _deterministic,
        "arrays given and taken are not shared": _arrays_are_not_shared,
        "a resumed search goes on as if nothing had been": _resumes,
        "a restored state is its own": _restored_is_its_own,
        "to_beat has one value for each genome": _to_beat,
        "racing changes nothing": _races,
        "calls out of turn are refused": _turns,
        "bad states are refused and leave no trace": _bad_states,
        "NaN is the worst and never the best": _nan,
        "a generation of nothing but the worst is survived": _only_the_worst,
    }
)
"""Checks of the properties, by what has to hold."""
