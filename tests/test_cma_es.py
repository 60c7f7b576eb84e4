"""Restarts, replay, and what `cmaes` makes of fitness that is no number."""

import numpy as np
import pytest

from evolution.search.cma_es import (
    CmaEs,
    CmaEsParameters,
    has_stagnated,
    made_finite,
    stagnation_window,
)
from evolution.search.search_space import SearchSpace
from evolution.search.symmetric_cma import SymmetricCma

SPACE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-5, init_upper=5)


def make(seed=0, space=SPACE, population=6, **changes) -> CmaEs:
    parameters = CmaEsParameters(population, **changes)
    return CmaEs(parameters, space, np.random.default_rng(seed))


def sphere(genomes: np.ndarray) -> np.ndarray:
    return -np.sum(genomes**2, axis=-1)


def flat(genomes: np.ndarray) -> np.ndarray:
    return np.zeros(len(genomes))


def evolve(optimizer: CmaEs, n_generations: int, fitness=sphere) -> CmaEs:
    for _ in range(n_generations):
        optimizer.tell(fitness(optimizer.ask()))
    return optimizer


def sizes(optimizer: CmaEs, n_generations: int, fitness=sphere) -> list[int]:
    """Number of genomes of each of so many generations."""
    return [len(evolve(optimizer, 1, fitness).fitness) for _ in range(n_generations)]


def assert_same(a: CmaEs, b: CmaEs) -> None:
    """Equal in what is stored and, to the last bit, in what is asked from here on."""
    assert a.generation == b.generation
    np.testing.assert_array_equal(a.state()["told"], b.state()["told"])
    np.testing.assert_array_equal(a.population, b.population)
    np.testing.assert_array_equal(a.fitness, b.fitness)
    for _ in range(3):
        genomes = a.ask()
        np.testing.assert_array_equal(genomes, b.ask())
        a.tell(sphere(genomes))
        b.tell(sphere(genomes))


# Of a flat fitness the range over 10 + ceil(30 * 3 / 6) = 25 generations is 0.
FIRST_START = 26


# --- Parameters ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"population": 3},
            "^population: expected a whole number from 4 to 100,000, got 3$",
        ),
        ({"sigma": 0.0}, "^sigma: expected a number above 0, at most .*, got 0.0$"),
        ({"sigma": np.nan}, "^sigma: expected a number above 0, at most .*, got nan$"),
        ({"sigma": np.inf}, "^sigma: expected a number above 0, at most .*, got inf$"),
        ({"sigma": 10.5}, "^sigma: expected at most 10, the width of .*, got 10.5$"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


@pytest.mark.parametrize("genes", [1, 2, 40])
def test_the_smallest_population_searches(genes):
    space = SearchSpace(genes, lower=-5, upper=5, init_lower=-5, init_upper=5)
    optimizer = make(space=space, population=4, restarts=False)
    before = evolve(optimizer, 1).fitness.max()
    assert evolve(optimizer, 150).fitness.max() > before


# --- One start -----------------------------------------------------------------------


def test_it_is_the_packages():
    optimizer = make(seed=7, restarts=False)
    rng = np.random.default_rng(7)
    cma = SymmetricCma(
        mean=rng.uniform(-5, 5, size=3),
        sigma=2.0,
        bounds=np.array([[-5, 5]] * 3),
        seed=int(rng.integers(2**32)),
        population_size=6,
    )
    for _ in range(30):
        genomes = [cma.ask() for _ in range(6)]
        np.testing.assert_array_equal(optimizer.ask(), genomes)
        cma.tell([(genome, float(np.sum(genome**2))) for genome in genomes])
        optimizer.tell(sphere(np.array(genomes)))


def test_samples_do_not_depend_on_which_eigenvectors_the_library_finds():
    rng = np.random.default_rng(1)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    # equal eigenvalues: every rotation of the first two axes is as good
    lengths = np.array([2.0, 2.0, 0.5])
    c, s = np.cos(0.7), np.sin(0.7)
    turned = rotation @ np.array([[c, -s, 0], [s, c, 0], [0, 0, -1]])
    samples = []
    for axes in (rotation, turned):
        cma = SymmetricCma(mean=np.ones(3), sigma=1.0, seed=5)
        cma._B, cma._D = axes, lengths
        samples.append([cma.ask() for _ in range(2000)])
    np.testing.assert_allclose(samples[0], samples[1], rtol=0, atol=1e-12)
    covariance = rotation * lengths**2 @ rotation.T
    np.testing.assert_allclose(np.cov(np.transpose(samples[0])), covariance, atol=0.4)


def test_it_turns_to_a_narrow_oblique_valley():
    def valley(genomes):
        across = genomes[:, 0] - genomes[:, 1]
        return -1e6 * across**2 + sphere(genomes)

    assert evolve(make(population=10), 120, valley).fitness.max() > -1e-6


def test_the_population_are_those_last_told_good_or_bad():
    optimizer = evolve(make(), 2)
    genomes = optimizer.ask()
    optimizer.tell([1, 2, 3, np.nan, 5, -np.inf])
    np.testing.assert_array_equal(optimizer.population, genomes)
    assert optimizer.fitness.tolist() == [1, 2, 3, -np.inf, 5, -np.inf]


# --- Restarts ------------------------------------------------------------------------


def test_a_restart_doubles_the_population():
    optimizer = make()
    assert sizes(optimizer, FIRST_START, flat) == [6] * FIRST_START
    assert optimizer.fitness.shape == (6,)
    # the next one is known beforehand: it costs more
    assert optimizer.next_size() == 12
    # 10 + ceil(30 * 3 / 12) = 18, 10 + ceil(30 * 3 / 24) = 14
    assert sizes(optimizer, 19 + 15 + 1, flat) == [12] * 19 + [24] * 15 + [48]
    assert optimizer.population.shape == (48, 3)


def test_a_restart_begins_anywhere_with_the_first_sigma():
    space = SearchSpace(genes=2, lower=-5, upper=5, init_lower=-4, init_upper=4)
    means, spreads = [], []
    for seed in range(40):
        optimizer = make(seed, space, population=40, sigma=0.1)
        while optimizer.next_size() == 40:
            evolve(optimizer, 1, flat)
        genomes = optimizer.ask()
        assert len(genomes) == 80
        means.append(genomes.mean(axis=0))
        spreads.append(genomes.std(axis=0))
    assert np.mean(spreads) == pytest.approx(0.1, rel=0.05)
    assert np.abs(means).max() < 4.1
    # uniform between -4 and 4
    assert np.std(means) == pytest.approx(8 / np.sqrt(12), rel=0.15)


def test_it_restarts_when_the_sphere_is_solved():
    optimizer, best = make(), -np.inf
    while optimizer.next_size() == 6:
        best = max(best, evolve(optimizer, 1).fitness.max())
    assert best > -1e-12
    # it looks elsewhere
    assert evolve(optimizer, 1).fitness.max() < -0.01


def test_the_window_by_hand():
    # the source's 120 + 30 n / lambda at first, and a fifth of a long start
    assert stagnation_window(1, genes=40, population=15) == 200
    assert stagnation_window(1000, genes=40, population=15) == 200
    assert stagnation_window(1500, genes=40, population=15) == 300
    assert stagnation_window(1, genes=40, population=1200) == 121
    assert stagnation_window(10**6, genes=40, population=15) == 20000


def test_stagnation_by_hand():
    rising, flat = np.arange(10.0), np.zeros(10)
    falling, late = -rising, np.repeat([0.0, 1.0], [8, 2])

    def stagnated(*columns, window=10):
        return has_stagnated(np.transpose(columns), window)

    assert stagnated(flat, flat)
    assert stagnated(falling, flat)
    # one of them is enough to go on
    assert not stagnated(rising, flat)
    assert not stagnated(falling, rising)
    # the medians of 0, 0, 0 and of 0, 1, 1
    assert not stagnated(late, flat)
    # one lucky generation is not progress
    assert stagnated(np.repeat([0.0, 9.0], [9, 1]), flat)
    # what was before the window does not count, and a short history says nothing
    assert stagnated(np.repeat([0.0, 1.0], [2, 8]), flat, window=8)
    assert not stagnated(flat, flat, window=11)
    infinite = np.repeat([-np.inf, np.inf], 5)
    assert not stagnated(infinite, flat)
    assert stagnated(infinite[::-1], np.full(10, -np.inf))


def noise(seed: int):
    rng = np.random.default_rng(seed)
    return lambda genomes: rng.random(len(genomes))


@pytest.mark.parametrize("seed", range(3))
def test_it_restarts_when_all_that_is_left_is_noise(seed):
    optimizer, fitness = make(seed), noise(seed)
    generations = sizes(optimizer, 300, fitness)
    # 120 + 30 * 3 / 6 generations at least
    assert generations[:135] == [6] * 135
    assert {6, 12} <= set(generations)
    assert set(sizes(make(seed, restarts=False), 300, noise(seed))) == {6}


def test_progress_below_the_noise_is_progress():
    optimizer, noisy = make(), noise(0)

    def rising(genomes):
        return noisy(genomes) + 0.01 * optimizer.generation

    assert set(sizes(optimizer, 600, rising)) == {6}


def test_without_restarts_it_goes_on():
    assert sizes(make(restarts=False), 300, flat) == [6] * 300
    optimizer = evolve(make(restarts=False), 1000)
    assert optimizer.fitness.shape == (6,)
    assert np.isfinite(optimizer.population).all()


# --- Learning rates that adapt -------------------------------------------------------


def test_the_flag_reaches_the_package():
    for adapts in (False, True):
        optimizer = make(seed=7, restarts=False, learning_rate_adaptation=adapts)
        rng = np.random.default_rng(7)
        cma = SymmetricCma(
            mean=rng.uniform(-5, 5, size=3),
            sigma=2.0,
            bounds=np.array([[-5, 5]] * 3),
            seed=int(rng.integers(2**32)),
            population_size=6,
            lr_adapt=adapts,
        )
        for _ in range(30):
            genomes = [cma.ask() for _ in range(6)]
            np.testing.assert_array_equal(optimizer.ask(), genomes)
            cma.tell([(genome, float(np.sum(genome**2))) for genome in genomes])
            optimizer.tell(sphere(np.array(genomes)))


@pytest.mark.parametrize("seed", range(3))
def test_learning_slowly_gets_nearer_under_noise(seed):
    space = SearchSpace(genes=10, lower=-5, upper=5, init_lower=-5, init_upper=5)
    distances = []
    for adapts in (False, True):
        rng = noise(seed)
        optimizer = make(
            seed, space, 10, restarts=False, learning_rate_adaptation=adapts
        )

        def noisy(genomes, rng=rng):
            return sphere(genomes) + 20 * rng(genomes)

        evolve(optimizer, 1000, noisy)
        distances.append(np.linalg.norm(optimizer._cma.mean))
    assert distances[1] < distances[0] / 2


def test_replay_is_exact_with_learning_rates_that_adapt():
    def adapting(seed=0):
        return make(seed, restarts=False, learning_rate_adaptation=True)

    resumed = evolve(adapting(seed=9), 70, noise(3))
    resumed.restore(evolve(adapting(), 150, noise(2)).state())
    assert_same(resumed, evolve(adapting(), 150, noise(2)))


# --- Replay --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("n_before", "next_size"),
    [(FIRST_START - 1, 6), (FIRST_START, 12), (FIRST_START + 1, 12), (50, 24)],
)
def test_replay_is_exact_around_and_across_restarts(n_before, next_size):
    state = evolve(make(), n_before, flat).state()
    resumed = evolve(make(seed=9), 70, flat)
    resumed.restore(state)
    assert resumed.next_size() == next_size
    assert_same(resumed, evolve(make(), n_before, flat))


def test_replay_is_exact_across_stagnation():
    optimizer, fitness = make(), noise(0)
    while optimizer.next_size() == 6:
        evolve(optimizer, 1, fitness)
    # the next start remembers its own generations only
    evolve(optimizer, 100, fitness)
    resumed = evolve(make(seed=9), 150, noise(1))
    resumed.restore(optimizer.state())
    rest = noise(2), noise(2)
    told = sizes(resumed, 100, rest[0])
    assert told == sizes(optimizer, 100, rest[1])
    # over the next restart
    assert {12, 24} == set(told)
    assert_same(resumed, optimizer)


def test_a_restored_state_is_a_state():
    state = evolve(make(), 40, flat).state()
    resumed = make(seed=9)
    resumed.restore(state)
    again = resumed.state()
    assert again.keys() == state.keys()
    for key in state:
        np.testing.assert_array_equal(again[key], state[key])


def test_the_state_holds_what_was_told_in_order():
    optimizer = make()
    told = [[1, 2, 3, 4, 5, 6], [7, np.nan, 9, 8, -np.inf, 0]]
    assert optimizer.state()["told"].shape == (0,)
    for fitness in told:
        optimizer.ask()
        optimizer.tell(fitness)
    expected = [1, 2, 3, 4, 5, 6, 7, -np.inf, 9, 8, -np.inf, 0]
    assert optimizer.state()["told"].tolist() == expected


@pytest.mark.parametrize(
    ("told", "generation", "got"),
    [
        (np.zeros(17), 3, "got 17 values, of 2 generations and 5 more"),
        (np.zeros(19), 3, "got 19 values, of 3 generations and 1 more"),
        (np.zeros(24), 3, "got 24 values, of 4 generations and 0 more"),
        (np.zeros(0), 3, "got 0 values, of 0 generations and 0 more"),
        (np.zeros(18), -3, "got 18 values, of 3 generations"),
        # 26 generations of 6, then half of the first one of 12
        (np.zeros(162), 27, "got 162 values, of 26 generations and 6 more"),
        (np.zeros((3, 6)), 3, r"'told': expected float64 \(18,\), got float64 \(3, 6"),
        (np.array(0.0), 3, r"'told': expected float64 \(1,\), got float64 \(\)"),
        (np.zeros(18, int), 3, "'told': expected float64 .*, got int64"),
        (np.zeros(18, np.float32), 3, "'told': expected float64 .*, got float32"),
    ],
)
def test_told_that_is_no_history_is_refused_and_leaves_no_trace(told, generation, got):
    good = evolve(make(), 3).state()
    optimizer = evolve(make(seed=4), 30, flat)
    with pytest.raises(ValueError, match=got):
        optimizer.restore({**good, "told": told, "generation": np.array(generation)})
    assert_same(optimizer, evolve(make(seed=4), 30, flat))


# --- Fitness that is no number -------------------------------------------------------


def test_made_finite_by_hand():
    inf = np.inf
    values = made_finite(np.array([2.0, -inf, -1.0, inf, 0.0]))
    below, above = np.nextafter(-1, -inf), np.nextafter(2, inf)
    assert values.tolist() == [2, below, -1, above, 0]
    # strictly in order
    assert np.argsort(values).tolist() == [1, 2, 4, 0, 3]
    numbers = np.array([3.0, 1.0, 2.0])
    np.testing.assert_array_equal(made_finite(numbers), numbers)
    assert len(set(made_finite(np.full(4, -inf)).tolist())) == 1
    assert np.abs(made_finite(np.array([-inf, inf]))).max() < 1e-300


@pytest.mark.parametrize(
    "hole", [np.nan, -np.inf, np.inf], ids=["nan", "minus inf", "inf"]
)
def test_holes_break_nothing(hole):
    rng = np.random.default_rng(0)

    def holed(genomes):
        return np.where(rng.random(len(genomes)) < 0.3, hole, sphere(genomes))

    optimizer = make(population=12)
    for _ in range(150):
        genomes = optimizer.ask()
        assert np.isfinite(genomes).all()
        optimizer.tell(holed(genomes))


@pytest.mark.parametrize("worst", [-np.inf, np.nan, np.inf])
def test_a_whole_generation_of_them_is_flat(worst):
    def broken(genomes):
        return np.full(len(genomes), worst)

    a, b = evolve(make(), FIRST_START, broken), evolve(make(), FIRST_START, flat)
    assert a.next_size() == b.next_size() == 12
    np.testing.assert_array_equal(a.ask(), b.ask())
