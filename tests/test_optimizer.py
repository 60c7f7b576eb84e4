"""Properties that every shipped optimiser and its main variants must have."""

import io
from dataclasses import asdict, replace

import numpy as np
import pytest

from evolution.search.evolution_strategy import EvolutionStrategyParameters
from evolution.search.table import (
    ALGORITHMS,
    AskTellError,
    Optimizer,
    SearchSpace,
    make_optimizer,
)
from tests.shipped import BASELINES, OPTIMIZERS, PAPERS

CUBE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-5, init_upper=5)
LOPSIDED = SearchSpace(genes=3, lower=-0.5, upper=1.5, init_lower=-0.5, init_upper=1.5)

BEST, RAND, GA = (OPTIMIZERS[name] for name in PAPERS)
RANDOM, ES, CMA = (OPTIMIZERS[name] for name in BASELINES)
VARIANTS = {
    **OPTIMIZERS,
    "de-best reevaluated": replace(BEST, reevaluate_parents=True),
    "de-best reinit": replace(BEST, bounds_rule="reinit", crossover=0.5),
    "de-rand clip": replace(RAND, bounds_rule="clip"),
    "de-rand reflect": replace(RAND, bounds_rule="reflect", scale=2.0),
    "ga odd, elites": replace(GA, population=31, elites=2),
    "ga 32 bits": replace(GA, bits=32),
    "random-search small": replace(RANDOM, population=7),
    "one-plus-one-es reinit": replace(ES, bounds_rule="reinit", sigma=2.0),
    "cma-es without restarts": replace(CMA, restarts=False, population=20),
}
every_variant = pytest.mark.parametrize("variant", VARIANTS)


def make(variant: str, seed: int = 0, space: SearchSpace = CUBE) -> Optimizer:
    return make_optimizer(VARIANTS[variant], space, np.random.default_rng(seed))


def sphere(genomes: np.ndarray) -> np.ndarray:
    return -np.sum(genomes**2, axis=-1)


def n_individuals(variant: str) -> int:
    parameters = VARIANTS[variant]
    if isinstance(parameters, EvolutionStrategyParameters):
        return parameters.lineages
    return parameters.population


def found(variant: str) -> float:
    """What the sphere's best must exceed after 60 generations: search or luck."""
    return {"random-search": -1.0, "random-search small": -5.0}.get(variant, -0.1)


def evolve(optimizer: Optimizer, n_generations: int, fitness=sphere) -> Optimizer:
    for _ in range(n_generations):
        optimizer.tell(fitness(optimizer.ask()))
    return optimizer


def assert_same(a: Optimizer, b: Optimizer) -> None:
    """Equal in every array, and in what they ask next."""
    left, right = a.state(), b.state()
    assert left.keys() == right.keys()
    for key in left:
        np.testing.assert_array_equal(left[key], right[key], err_msg=key)
    np.testing.assert_array_equal(a.population, b.population)
    np.testing.assert_array_equal(a.ask(), b.ask())


def saved_and_loaded(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **state)
    file.seek(0)
    with np.load(file, allow_pickle=False) as arrays:
        return dict(arrays)


# --- The table -----------------------------------------------------------------------


def test_shipped_names_are_the_optimisers_own():
    assert all(make(name).name == name for name in OPTIMIZERS)


def test_algorithms_are_the_kinds_of_parameters_by_their_tags():
    assert list(ALGORITHMS) == [
        "differential_evolution",
        "genetic_algorithm",
        "random_search",
        "evolution_strategy",
        "cma_es",
    ]
    for parameters in OPTIMIZERS.values():
        assert ALGORITHMS[parameters.algorithm] is type(parameters)


def test_shipped_parameters_are_the_papers():
    paper = {
        "de-best": {
            "strategy": "best",
            "population": 150,
            "scale": 0.8,
            "crossover": 1,
        },
        "de-rand": {
            "strategy": "rand",
            "population": 120,
            "scale": 0.7,
            "crossover": 1,
        },
        "ga": {"population": 100, "crossover": 0.85, "mutation": 0.01, "elites": 0},
    }
    for name, values in paper.items():
        assert asdict(OPTIMIZERS[name]).items() >= values.items()


@pytest.mark.parametrize(
    "values",
    [
        (0, -5, 5, -5, 5),
        (3, 5, -5, -5, 5),
        (3, 1, 1, 1, 1),
        (3, -np.inf, 5, -5, 5),
        (3, np.nan, 5, -5, 5),
        (3, -5, 5, -6, 5),
        (3, -5, 5, -5, 6),
        (3, -5, 5, 2, 1),
    ],
)
def test_impossible_space_is_refused(values):
    with pytest.raises(ValueError, match="expected"):
        SearchSpace(*values)


# --- Searching -----------------------------------------------------------------------


@pytest.mark.parametrize("name", ["de-best", "de-rand", "de-best reevaluated"])
def test_differential_evolution_solves_the_sphere(name):
    assert evolve(make(name), 100).fitness.max() > -1e-6


@pytest.mark.parametrize("name", ["ga", "ga odd, elites"])
def test_genetic_algorithm_solves_the_sphere_to_its_grid(name):
    optimizer = evolve(make(name), 100)
    best = optimizer.population[np.argmax(optimizer.fitness)]
    # 256 levels over 10: the two nearest to 0 are half a level away, allow one more.
    assert np.abs(best).max() <= 1.5 * 10 / 255 + 1e-12


@pytest.mark.parametrize("name", ["one-plus-one-es", "one-plus-one-es reinit"])
def test_evolution_strategies_solve_the_sphere(name):
    optimizer = evolve(make(name), 400)
    # Each of them: they are independent.
    assert optimizer.fitness.min() > -1e-6


@pytest.mark.parametrize("name", ["cma-es", "cma-es without restarts"])
def test_cma_es_solves_the_sphere(name):
    assert evolve(make(name), 60).fitness.max() > -1e-6


@pytest.mark.parametrize("name", ["random-search", "random-search small"])
def test_random_search_only_improves(name):
    optimizer = evolve(make(name), 1)
    for _ in range(30):
        before = np.sort(optimizer.fitness)
        evolve(optimizer, 1)
        assert np.all(np.sort(optimizer.fitness) >= before)
    assert (
        np.sort(optimizer.fitness).sum() > np.sort(evolve(make(name), 1).fitness).sum()
    )


@every_variant
@pytest.mark.parametrize("space", [CUBE, LOPSIDED], ids=["cube", "lopsided"])
def test_bounds_are_obeyed_even_where_the_best_is_a_corner(variant, space):
    optimizer = make(variant, space=space)
    for _ in range(30):
        genomes = optimizer.ask()
        assert genomes.min() >= space.lower
        assert genomes.max() <= space.upper
        optimizer.tell(genomes @ [1.0, -1.0, 1.0])


@every_variant
def test_first_genomes_fill_the_initial_range(variant):
    # Of several seeds, since ten individuals may miss an end.
    genomes = np.concatenate([make(variant, seed).ask() for seed in range(10)])
    assert np.all(genomes.min(axis=0) < -4.5)
    assert np.all(genomes.max(axis=0) > 4.5)


@every_variant
def test_shapes_counts_and_sizes(variant):
    optimizer = make(variant)
    population = n_individuals(variant)
    assert optimizer.fitness.tolist() == [-np.inf] * population
    for generation in range(4):
        assert optimizer.generation == generation
        assert optimizer.population.shape == (population, 3)
        assert optimizer.fitness.shape == (population,)
        expected = optimizer.next_size()
        genomes = optimizer.ask()
        assert genomes.shape == (expected, 3)
        assert genomes.dtype == np.float64
        assert optimizer.next_size() == expected
        optimizer.tell(sphere(genomes))


@every_variant
def test_stored_fitness_belongs_to_the_stored_genomes(variant):
    optimizer = evolve(make(variant), 7)
    np.testing.assert_array_equal(optimizer.fitness, sphere(optimizer.population))


@every_variant
def test_first_tell_stores_the_initial_population(variant):
    optimizer = make(variant)
    genomes = optimizer.ask()
    np.testing.assert_array_equal(genomes, optimizer.population)
    optimizer.tell(sphere(genomes))
    np.testing.assert_array_equal(genomes, optimizer.population)


# --- Determinism ---------------------------------------------------------------------


@every_variant
def test_same_seed_same_search(variant):
    assert_same(evolve(make(variant), 10), evolve(make(variant), 10))


@every_variant
def test_other_seed_other_search(variant):
    a, b = make(variant, seed=1).ask(), make(variant, seed=2).ask()
    assert not np.array_equal(a, b)


@every_variant
def test_arrays_given_and_taken_are_not_shared(variant):
    careless, careful = make(variant), make(variant)
    for _ in range(5):
        genomes = careless.ask()
        fitness = sphere(genomes)
        genomes[:] = 99
        careless.tell(fitness)
        fitness[:] = 99
        for array in careless.state().values():
            array[...] = array.dtype.type(0)
    assert_same(careless, evolve(careful, 5))


@every_variant
def test_population_and_fitness_are_read_only(variant):
    for optimizer in (make(variant), evolve(make(variant), 2)):
        for array in (optimizer.population, optimizer.fitness):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0


@every_variant
@pytest.mark.parametrize("n_before", [0, 1, 5])
def test_resume_is_exact(variant, n_before, tmp_path):
    path = tmp_path / "state.npz"
    np.savez(path, allow_pickle=False, **evolve(make(variant), n_before).state())
    resumed = make(variant, seed=123)
    with np.load(path, allow_pickle=False) as state:
        resumed.restore(state)
    assert resumed.generation == n_before
    assert_same(evolve(resumed, 10 - n_before), evolve(make(variant), 10))


@every_variant
def test_restored_arrays_are_not_shared(variant):
    state = evolve(make(variant), 3).state()
    resumed = make(variant)
    resumed.restore(state)
    for array in state.values():
        array[...] = array.dtype.type(0)
    assert_same(resumed, evolve(make(variant), 3))


@every_variant
def test_restore_forgets_what_was_asked(variant):
    state = evolve(make(variant), 3).state()
    resumed = make(variant)
    resumed.ask()
    resumed.restore(state)
    assert_same(resumed, evolve(make(variant), 3))


@pytest.mark.parametrize("kind", ["PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64"])
def test_every_numpy_generator_can_be_saved(kind):
    def fresh(seed: int) -> Optimizer:
        bit_generator = getattr(np.random, kind)(seed)
        rng = np.random.Generator(bit_generator)
        return make_optimizer(OPTIMIZERS["ga"], CUBE, rng)

    resumed = fresh(1)
    resumed.restore(saved_and_loaded(evolve(fresh(0), 2).state()))
    assert_same(evolve(resumed, 2), evolve(fresh(0), 4))


# --- Racing --------------------------------------------------------------------------


def plateaus(genomes: np.ndarray) -> np.ndarray:
    """The sphere in steps, so that many are told exactly what they have to beat."""
    return np.round(sphere(genomes) / 4)


@every_variant
def test_to_beat_has_one_value_for_each_genome_asked(variant):
    optimizer = make(variant)
    for generation in range(4):
        genomes = optimizer.ask()
        to_beat = optimizer.to_beat()
        assert to_beat.shape == (len(genomes),)
        assert not np.isnan(to_beat).any()
        if generation == 0:
            assert np.all(to_beat == -np.inf)
        # the caller's to keep
        to_beat[:] = 99
        optimizer.tell(sphere(genomes))
    assert_same(optimizer, evolve(make(variant), 4))


@every_variant
def test_nothing_is_to_beat_before_something_is_asked(variant):
    optimizer = make(variant)
    for _ in range(2):
        with pytest.raises(AskTellError, match=r"expected ask\(\) first"):
            optimizer.to_beat()
        evolve(optimizer, 1)
    assert_same(optimizer, evolve(make(variant), 2))


@every_variant
@pytest.mark.parametrize("fitness", [sphere, plateaus])
def test_racing_is_exact(variant, fitness):
    honest, raced = make(variant), make(variant)
    for _ in range(15):
        evolve(honest, 1, fitness)
        told = fitness(raced.ask())
        raced.tell(np.where(told <= raced.to_beat(), -1e9, told))
        np.testing.assert_array_equal(raced.population, honest.population)
        np.testing.assert_array_equal(raced.fitness, honest.fitness)
    assert_same(raced, honest)


@pytest.mark.parametrize("variant", ["de-best", "random-search", "one-plus-one-es"])
def test_there_is_something_to_win_by_racing(variant):
    optimizer = evolve(make(variant), 10)
    genomes = optimizer.ask()
    assert np.mean(sphere(genomes) <= optimizer.to_beat()) > 0.5


# --- Misuse --------------------------------------------------------------------------


@every_variant
def test_calls_out_of_turn_are_refused(variant):
    optimizer = make(variant)
    with pytest.raises(AskTellError, match=r"nothing to tell: expected ask\(\) first"):
        optimizer.tell(np.zeros(optimizer.next_size()))
    genomes = optimizer.ask()
    with pytest.raises(AskTellError, match=f"expected tell.. with {len(genomes)} "):
        optimizer.ask()
    with pytest.raises(AskTellError, match="cannot take the state"):
        optimizer.state()
    optimizer.tell(sphere(genomes))
    with pytest.raises(AskTellError, match="nothing to tell"):
        optimizer.tell(sphere(genomes))
    assert_same(optimizer, evolve(make(variant), 1))


@every_variant
def test_wrong_shape_is_refused_and_can_be_mended(variant):
    optimizer = evolve(make(variant), 1)
    genomes = optimizer.ask()
    fitness = sphere(genomes)
    for wrong in (1.0, fitness[:-1], fitness[:, np.newaxis], np.append(fitness, 0)):
        with pytest.raises(AskTellError, match=rf"\({len(genomes)},\).* got \("):
            optimizer.tell(wrong)
    optimizer.tell(fitness)
    assert_same(optimizer, evolve(make(variant), 2))


@every_variant
def test_bad_states_are_refused_and_leave_no_trace(variant):
    optimizer = evolve(make(variant), 3)
    good = evolve(make(variant, seed=9), 5).state()
    for key in good:
        lacking = {k: v for k, v in good.items() if k != key}
        with pytest.raises(ValueError, match=f"state lacks {key}; expected name, "):
            optimizer.restore(lacking)
        with pytest.raises(ValueError, match="expected"):
            optimizer.restore({**good, key: np.stack([good[key]] * 2)})
        with pytest.raises(ValueError, match="expected"):
            optimizer.restore({**good, key: np.zeros(good[key].shape, dtype=complex)})
    with pytest.raises(ValueError, match="expected the state of a PCG64"):
        optimizer.restore({**good, "generator": np.array("{}")})
    with pytest.raises(ValueError, match=r"expected a state of '.*', got 'pso'"):
        optimizer.restore({**good, "name": np.array("pso")})
    assert_same(optimizer, evolve(make(variant), 3))


# --- Fitness that is no number -------------------------------------------------------


def holed(genomes: np.ndarray) -> np.ndarray:
    """The sphere, not a number in half of the box."""
    return np.where(genomes[:, 0] > 0, np.nan, sphere(genomes))


@every_variant
def test_nan_is_the_worst_and_never_kept(variant):
    optimizer = make(variant)
    genomes = optimizer.ask()
    optimizer.tell(holed(genomes))
    np.testing.assert_array_equal(optimizer.fitness == -np.inf, genomes[:, 0] > 0)
    for _ in range(60):
        optimizer.tell(holed(optimizer.ask()))
        assert not np.isnan(optimizer.fitness).any()
    best = np.argmax(optimizer.fitness)
    assert optimizer.population[best, 0] <= 0
    assert optimizer.fitness[best] > found(variant)


@every_variant
def test_nothing_but_the_worst_fitness_is_survived(variant):
    optimizer = evolve(make(variant), 5, lambda g: np.full(len(g), -np.inf))
    assert np.all(optimizer.fitness == -np.inf)
    assert np.isfinite(optimizer.population).all()
    assert evolve(optimizer, 60).fitness.max() > found(variant)
