"""Properties that every shipped optimiser and its main variants must have."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from epuck_mj.errors import UserError
from evolution.search.ask_tell import read_only
from evolution.search.properties import (
    CUBE,
    PROPERTIES,
    Make,
    check_optimizer,
    evolved,
    same,
    saved_and_loaded,
    sphere,
)
from evolution.search.random_search import RandomSearch, RandomSearchParameters
from evolution.search.table import (
    ALGORITHMS,
    Optimizer,
    SearchSpace,
    make_optimizer,
)
from tests.shipped import BASELINES, HYBRIDS, OPTIMIZERS, PAPERS

BEST, RAND, GA = (OPTIMIZERS[name] for name in PAPERS)

RANDOM, ES, CMA, LRA, LSHADE, OPENAI, SSSHC = (OPTIMIZERS[name] for name in BASELINES)
SEQUENCE, IMITATED, MEMETIC, LEARNING = (OPTIMIZERS[name] for name in HYBRIDS)
VARIANTS = {
    **OPTIMIZERS,
    # a run fills in its evaluations
    "l-shade": replace(LSHADE, budget=30_000),
    "de-best-then-cma-es": replace(SEQUENCE, budget=1000),
    "imitators-then-cma-es": replace(IMITATED, budget=1000),
    "small de-best then cma-es": replace(
        SEQUENCE, first=replace(BEST, population=20), budget=100
    ),
    "de-best then de-rand": replace(
        SEQUENCE,
        first=replace(BEST, population=20),
        then=replace(RAND, population=20),
        budget=200,
    ),
    "cma-es then de-rand": replace(
        SEQUENCE,
        first=replace(CMA, restarts=False, population=20),
        then=replace(RAND, population=20, reevaluate_best=3),
        share=0.5,
        budget=200,
    ),
    "memetic-de narrow": replace(MEMETIC, refinements=1, sigma=0.1),
    "memetic-de, the best reevaluated": replace(
        MEMETIC, evolution=replace(BEST, reevaluate_best=10)
    ),
    "baldwinian": replace(LEARNING, inheritance="baldwinian"),
    "learning, parents reevaluated": replace(
        LEARNING, evolution=replace(BEST, reevaluate_parents=True)
    ),
    "de-best reevaluated": replace(BEST, reevaluate_parents=True),
    "de-best, the best reevaluated": replace(BEST, reevaluate_best=10),
    "de-rand, all of them": replace(RAND, population=20, reevaluate_best=20),
    "de-best reinit": replace(BEST, bounds_rule="reinit", crossover=0.5),
    "de-rand clip": replace(RAND, bounds_rule="clip"),
    "de-rand reflect": replace(RAND, bounds_rule="reflect", scale=2.0),
    "ga odd, elites": replace(GA, population=31, elites=2),
    "ga 32 bits": replace(GA, bits=32),
    "ga gray": replace(GA, coding="gray"),
    "ga two points": replace(GA, crossover_points=2, population=31),
    "random-search small": replace(RANDOM, population=7),
    "one-plus-one-es reinit": replace(ES, bounds_rule="reinit", sigma=2.0),
    "one-plus-one-es as first shipped": replace(ES, reevaluate_parents=False),
    "cma-es without restarts": replace(CMA, restarts=False, population=20),
    "lra-cma-es with restarts": replace(LRA, restarts=True, population=20),
    "l-shade shrinking": replace(LSHADE, population=30, budget=500),
    "l-shade without archive": replace(
        LSHADE, population=12, budget=400, archive_rate=0
    ),
    "l-shade one memory": replace(
        LSHADE, population=31, budget=900, archive_rate=0.5, memory=1, p_best=1.0
    ),
    "openai-es decaying": replace(OPENAI, pairs=7, weight_decay=0.01),
    "openai-es wide": replace(OPENAI, sigma=1.0, learning_rate=0.3),
    "ssshc steady": replace(SSSHC, refinements=0, stochasticity=0.0, mutation=0.3),
    "ssshc refined": replace(SSSHC, population=11, refinements=4, stochasticity=1.0),
}
every_variant = pytest.mark.parametrize("variant", VARIANTS)


def make(variant: str, seed: int = 0, space: SearchSpace = CUBE) -> Optimizer:
    return make_optimizer(VARIANTS[variant], space, np.random.default_rng(seed))


def found(variant: str) -> float:
    """What the sphere's best must exceed after 60 generations: search or luck."""
    lucky = {"random-search": -1.0, "random-search small": -5.0}
    # half of the samples around its centre have no fitness
    pulled = {"openai-es": -0.5, "openai-es decaying": -0.5, "openai-es wide": -1.5}
    return (lucky | pulled).get(variant, -0.1)


# --- The table -----------------------------------------------------------------------


def test_shipped_names_are_the_optimisers_own():
    alone = [name for name in OPTIMIZERS if name not in HYBRIDS]
    assert all(make(name).name == name for name in alone)


def test_algorithms_are_the_kinds_of_parameters_by_their_tags():
    assert list(ALGORITHMS) == [
        "differential_evolution",
        "genetic_algorithm",
        "random_search",
        "evolution_strategy",
        "cma_es",
        "l_shade",
        "openai_es",
        "ssshc",
        "memetic_de",
        "sequence",
        "imitators",
        "lifetime_learning",
        "policy_gradient",
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


@pytest.mark.parametrize(
    "name",
    ["de-best", "de-rand", "de-best reevaluated", "de-best, the best reevaluated"],
)
def test_differential_evolution_solves_the_sphere(name):
    assert evolved(make(name), 100).fitness.max() > -1e-6


@pytest.mark.parametrize("name", ["ga", "ga odd, elites", "ga gray", "ga two points"])
def test_genetic_algorithm_solves_the_sphere_to_its_grid(name):
    optimizer = evolved(make(name), 100)
    best = optimizer.population[np.argmax(optimizer.fitness)]
    # 256 levels over 10: the two nearest to 0 are half a level away, allow one more.
    assert np.abs(best).max() <= 1.5 * 10 / 255 + 1e-12


@pytest.mark.parametrize(
    "name",
    [
        "one-plus-one-es",
        "one-plus-one-es reinit",
        "one-plus-one-es as first shipped",
    ],
)
def test_evolution_strategies_solve_the_sphere(name):
    optimizer = evolved(make(name), 400)
    # Each of them: they are independent.
    assert optimizer.fitness.min() > -1e-6


@pytest.mark.parametrize("name", ["cma-es", "cma-es without restarts"])
def test_cma_es_solves_the_sphere(name):
    assert evolved(make(name), 60).fitness.max() > -1e-6


def test_learning_rates_that_adapt_solve_the_sphere_later():
    # its mean learns a sixth as fast
    assert evolved(make("lra-cma-es"), 120).fitness.max() > -1e-6


@pytest.mark.parametrize("name", [name for name in VARIANTS if "l-shade" in name])
def test_l_shade_solves_the_sphere(name):
    assert evolved(make(name), 100).fitness.max() > -1e-6


@pytest.mark.parametrize("name", ["openai-es", "openai-es decaying"])
def test_openai_es_solves_the_sphere(name):
    optimizer = evolved(make(name), 400)
    # the centre, which stands last; its steps do not shrink
    assert optimizer.fitness[-1] > -0.05


@pytest.mark.parametrize("name", ["ssshc", "ssshc steady", "ssshc refined"])
def test_ssshc_solves_the_sphere_gene_by_gene(name):
    optimizer = evolved(make(name), 400)
    assert optimizer.fitness.max() > -1e-2


@pytest.mark.parametrize("name", ["random-search", "random-search small"])
def test_random_search_only_improves(name):
    optimizer = evolved(make(name), 1)
    for _ in range(30):
        before = np.sort(optimizer.fitness)
        evolved(optimizer, 1)
        assert np.all(np.sort(optimizer.fitness) >= before)
    assert (
        np.sort(optimizer.fitness).sum() > np.sort(evolved(make(name), 1).fitness).sum()
    )


# --- What every optimiser has ---------------------------------------------------------


@every_variant
@pytest.mark.parametrize("name", PROPERTIES)
def test_properties(name, variant):
    PROPERTIES[name](Make(VARIANTS[variant]))


class Forgetful(RandomSearch):
    """Has lost its place in the random stream when it is restored."""

    Parameters = RandomSearchParameters

    def load(self, arrays):
        super().load(arrays)
        self.population = read_only(arrays["population"][::-1])


def test_who_has_not_a_property_is_told_which():
    with pytest.raises(UserError, match="does not hold: a resumed search goes on"):
        check_optimizer("tests.test_optimizer:Forgetful")
    check_optimizer("genetic_algorithm", population=12)


# --- Determinism ---------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64"])
def test_every_numpy_generator_can_be_saved(kind):
    def fresh(seed: int) -> Optimizer:
        bit_generator = getattr(np.random, kind)(seed)
        rng = np.random.Generator(bit_generator)
        return make_optimizer(OPTIMIZERS["ga"], CUBE, rng)

    resumed = fresh(1)
    resumed.restore(saved_and_loaded(evolved(fresh(0), 2).state()))
    same(evolved(resumed, 2), evolved(fresh(0), 4))


# --- Racing --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "variant",
    [
        "de-best",
        "random-search",
        "one-plus-one-es as first shipped",
        "l-shade",
        "ssshc",
    ],
)
def test_there_is_something_to_win_by_racing(variant):
    optimizer = evolved(make(variant), 10)
    genomes = optimizer.ask()
    assert np.mean(sphere(genomes) <= optimizer.to_beat()) > 0.5


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
    optimizer = evolved(make(variant), 5, lambda g: np.full(len(g), -np.inf))
    assert np.all(optimizer.fitness == -np.inf)
    assert np.isfinite(optimizer.population).all()
    assert evolved(optimizer, 60).fitness.max() > found(variant)
