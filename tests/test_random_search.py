"""What is kept against a slow oracle, ties, and what is drawn."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from evolution.search.random_search import RandomSearch, RandomSearchParameters, best_of
from evolution.search.search_space import SearchSpace

# Neither a slow machine nor a lucky draw decides a test.
steady = settings(deadline=None, derandomize=True)

SPACE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-1, init_upper=2)


def make(seed=0, space=SPACE, population=4) -> RandomSearch:
    parameters = RandomSearchParameters(population)
    return RandomSearch(parameters, space, np.random.default_rng(seed))


@pytest.mark.parametrize("population", [0, -1])
def test_bad_parameters_are_refused(population):
    message = f"^population: expected a whole number .*, got {population}$"
    with pytest.raises(ValueError, match=message):
        make(population=population)


# --- What is kept --------------------------------------------------------------------


def test_the_best_by_hand():
    fitness = np.array([3.0, 1.0, 4.0, 1.0, 5.0])
    assert best_of(fitness, 2).tolist() == [2, 4]
    assert best_of(fitness, 3).tolist() == [0, 2, 4]
    # of the two ones the first
    assert best_of(fitness, 4).tolist() == [0, 1, 2, 4]
    assert best_of(fitness, 5).tolist() == [0, 1, 2, 3, 4]


fitnesses = st.lists(st.sampled_from([-np.inf, -1.0, 0.0, 1.0, 2.0]), min_size=1)


@steady
@given(fitnesses, st.data())
def test_the_best_are_those_that_are_beaten_by_fewer_than_n(fitness, data):
    n = data.draw(st.integers(1, len(fitness)))
    # Ahead of i: whoever is better, or as good and older.
    kept = [
        i
        for i, own in enumerate(fitness)
        if sum(f > own or (f == own and k < i) for k, f in enumerate(fitness)) < n
    ]
    assert best_of(np.array(fitness), n).tolist() == kept


@pytest.mark.parametrize("population", [1, 2, 7])
def test_fast_is_slow(population):
    # Few values, so that ties of old and new and among the new happen.
    rng = np.random.default_rng(3)
    optimizer = make(population=population)
    kept: list[tuple[float, list[float]]] = []
    for _ in range(20):
        genomes = optimizer.ask()
        fitness = rng.integers(12, size=population).astype(float)
        optimizer.tell(fitness)
        # One after the other: the newcomer replaces the youngest of the worst, if it is
        # better than that.
        for genome, value in zip(genomes.tolist(), fitness.tolist(), strict=True):
            if len(kept) == population:
                worst = min(f for f, _ in kept)
                if value <= worst:
                    continue
                youngest = max(i for i, (f, _) in enumerate(kept) if f == worst)
                del kept[youngest]
            kept.append((value, genome))
        assert optimizer.fitness.tolist() == [value for value, _ in kept]
        assert optimizer.population.tolist() == [genome for _, genome in kept]


def test_ties_keep_the_older_and_nan_is_never_better():
    optimizer = make()
    first = optimizer.ask()
    optimizer.tell([1, 2, np.nan, 2])
    second = optimizer.ask()
    assert optimizer.to_beat().tolist() == [-np.inf] * 4
    optimizer.tell([2, np.nan, 1, -np.inf])
    np.testing.assert_array_equal(
        optimizer.population, [first[0], first[1], first[3], second[0]]
    )
    assert optimizer.fitness.tolist() == [1, 2, 2, 2]
    optimizer.ask()
    assert optimizer.to_beat().tolist() == [1, 1, 1, 1]
    optimizer.tell([1, 1, 1, 1])
    np.testing.assert_array_equal(optimizer.population[0], first[0])


# --- What is drawn -------------------------------------------------------------------


def test_every_generation_is_uniform_in_the_initial_range():
    optimizer = make(population=3000)
    for _ in range(3):
        genomes = optimizer.ask()
        uniform = scipy.stats.uniform(SPACE.init_lower, 3).cdf
        for gene in genomes.T:
            assert scipy.stats.kstest(gene, uniform).pvalue > 0.001
        optimizer.tell(genomes.sum(axis=1))


def test_nothing_that_is_told_changes_what_is_asked():
    a, b = make(), make()
    for _ in range(5):
        genomes = a.ask()
        np.testing.assert_array_equal(genomes, b.ask())
        a.tell(genomes.sum(axis=1))
        b.tell(-genomes.sum(axis=1))
