"""Mutations and noise counted, a slow oracle, and what becomes of means."""

import numpy as np
import pytest
import scipy.stats

from evolution.search.search_space import SearchSpace
from evolution.search.ssshc import (
    Ssshc,
    SsshcParameters,
    mutate_genes,
    mutate_one_gene,
    noisy,
)

SPACE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-1, init_upper=2)


def make(seed=0, space=SPACE, **changes) -> Ssshc:
    parameters = SsshcParameters(**changes)
    return Ssshc(parameters, space, np.random.default_rng(seed))


def sphere(genomes: np.ndarray) -> np.ndarray:
    return -np.sum(genomes**2, axis=-1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"population": 0}, "^population: expected a whole number from 1 to .*got 0$"),
        ({"mutation": 1.1}, "^mutation: expected a number from 0 to 1, got 1.1$"),
        ({"stochasticity": -0.1}, "^stochasticity: expected a number from 0 to 1, "),
        ({"refinements": -1}, "^refinements: expected a whole number from 0 to .*-1$"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


# --- Mutations and noise -------------------------------------------------------------


def test_mutated_genes_are_uniform_and_as_many_as_the_rate_says():
    genomes = np.full((20_000, 3), 9.0)
    mutated = mutate_genes(genomes, 0.1, SPACE, np.random.default_rng(0))
    changed = mutated != 9
    assert scipy.stats.binomtest(int(changed.sum()), 60_000, 0.1).pvalue > 0.001
    uniform = scipy.stats.uniform(-5, 10).cdf
    assert scipy.stats.kstest(mutated[changed], uniform).pvalue > 0.001
    assert (genomes == 9).all()


def test_mutation_0_and_1():
    genomes = np.full((50, 3), 9.0)
    rng = np.random.default_rng(0)
    assert (mutate_genes(genomes, 0.0, SPACE, rng) == 9).all()
    assert (mutate_genes(genomes, 1.0, SPACE, rng) != 9).all()


def test_one_gene_is_one_gene_and_each_equally_often():
    genomes = np.full((6000, 3), 9.0)
    mutated = mutate_one_gene(genomes, SPACE, np.random.default_rng(0))
    changed = mutated != 9
    assert (changed.sum(axis=1) == 1).all()
    assert scipy.stats.chisquare(changed.sum(axis=0)).pvalue > 0.001
    uniform = scipy.stats.uniform(-5, 10).cdf
    assert scipy.stats.kstest(mutated[changed], uniform).pvalue > 0.001
    assert (genomes == 9).all()


def test_noise_is_a_uniform_share_of_the_fitness():
    fitness = np.repeat([200.0, -3.0], 5000)
    shares = noisy(fitness, 0.2, np.random.default_rng(0)) / fitness - 1
    for half in (shares[:5000], shares[5000:]):
        uniform = scipy.stats.uniform(-0.2, 0.4).cdf
        assert scipy.stats.kstest(half, uniform).pvalue > 0.001


def test_noise_leaves_infinite_fitness_and_0_is_none():
    fitness = np.array([-np.inf, np.inf, 0.0])
    for _ in range(20):
        assert noisy(fitness, 1.0, np.random.default_rng(0)).tolist() == list(fitness)
    fitness = np.array([1.5, -2.5, 3e-7])
    assert noisy(fitness, 0.0, np.random.default_rng(0)).tolist() == list(fitness)


# --- Generations, slowly -------------------------------------------------------------


def slow_generations(n, mutation, stochasticity, refinements, fitness, told, seed):
    """Parents and what was told of each, with loops, given the optimiser's draws.

    Args:
        fitness: `(genome, generation)` to a number.
        told: number of generations.
    """
    rng = np.random.default_rng(seed)
    genes = SPACE.genes
    parents = rng.uniform(-1, 2, size=(n, genes)).tolist()
    seen = [[fitness(x, 0)] for x in parents]
    for generation in range(1, told):
        means = [sum(values) / len(values) for values in seen]
        if (generation - 1) % (1 + refinements) == 0:
            chosen = rng.random((n, genes)) < mutation
            values = rng.uniform(-5, 5, size=(n, genes))
            pool = []
            for i, x in enumerate(parents):
                y = [values[i, j] if chosen[i, j] else x[j] for j in range(genes)]
                pool.append((y, [fitness(y, generation)]))
            for x, old in zip(parents, seen, strict=True):
                pool.append((x, [*old, fitness(x, generation)]))
            noise = 1 + rng.uniform(-stochasticity, stochasticity, size=2 * n)
            compared = [
                sum(values) / len(values) * factor
                for (_, values), factor in zip(pool, noise, strict=True)
            ]
            ranking = sorted(range(2 * n), key=lambda k: -compared[k])
            pool = [pool[k] for k in sorted(ranking[:n])]
            parents, seen = [x for x, _ in pool], [values for _, values in pool]
        else:
            chosen = rng.integers(genes, size=n)
            values = rng.uniform(-5, 5, size=n)
            for i in range(n):
                y = list(parents[i])
                y[chosen[i]] = values[i]
                if fitness(y, generation) > means[i]:
                    parents[i], seen[i] = y, [fitness(y, generation)]
    return parents, seen


@pytest.mark.parametrize("n", [1, 6])
@pytest.mark.parametrize("refinements", [0, 1, 3])
@pytest.mark.parametrize("stochasticity", [0.0, 0.3])
def test_fast_is_slow(n, refinements, stochasticity):
    # Rounding makes plateaus; another generation is another environment.
    def fitness(genome, generation):
        return float(np.round(sphere(np.array(genome)) / 4)) + generation % 3

    optimizer = make(
        3,
        population=n,
        mutation=0.4,
        stochasticity=stochasticity,
        refinements=refinements,
    )
    for generation in range(14):
        asked = optimizer.ask()
        optimizer.tell([fitness(x, generation) for x in asked])
    parents, seen = slow_generations(
        n, 0.4, stochasticity, refinements, fitness, 14, seed=3
    )
    assert optimizer.population.tolist() == parents
    means = [sum(values) / len(values) for values in seen]
    np.testing.assert_allclose(optimizer.fitness, means, rtol=1e-12)
    counts = optimizer.state()["evaluations"].tolist()
    assert counts == [len(values) for values in seen]


# --- Selection and refinement by hand ------------------------------------------------


def test_sizes_follow_the_cycle():
    optimizer = make(population=5, refinements=2)
    sizes = []
    for _ in range(8):
        sizes.append(optimizer.next_size())
        optimizer.tell(sphere(optimizer.ask()))
    assert sizes == [5, 10, 5, 5, 10, 5, 5, 10]


def test_a_lucky_parent_loses_its_luck_and_its_place():
    optimizer = make(population=2, mutation=1.0, stochasticity=0.0)
    first = optimizer.ask()
    optimizer.tell([100.0, 10.0])
    asked = optimizer.ask()
    np.testing.assert_array_equal(asked[:2], first)
    # means are 40 and 10; the offspring 30 and 50
    optimizer.tell([-20.0, 10.0, 30.0, 50.0])
    np.testing.assert_array_equal(optimizer.population, [asked[3], first[0]])
    assert optimizer.fitness.tolist() == [50.0, 40.0]
    assert optimizer.state()["evaluations"].tolist() == [1, 2]


def test_offspring_win_ties_and_candidates_lose_them():
    optimizer = make(population=3, mutation=1.0, stochasticity=0.0)
    optimizer.tell(np.zeros(len(optimizer.ask())))
    asked = optimizer.ask()
    optimizer.tell(np.zeros(6))
    np.testing.assert_array_equal(optimizer.population, asked[3:])
    candidates = optimizer.ask()
    assert ((candidates != asked[3:]).sum(axis=1) == 1).all()
    optimizer.tell([0.0, np.nextafter(0, 1), -1.0])
    expected = [asked[3], candidates[1], asked[5]]
    np.testing.assert_array_equal(optimizer.population, expected)


def test_noise_lets_a_worse_one_survive():
    survived = 0
    for seed in range(200):
        optimizer = make(seed, population=1, mutation=1.0, stochasticity=0.2)
        optimizer.ask()
        optimizer.tell([10.0])
        asked = optimizer.ask()
        optimizer.tell([10.0, 9.0])
        survived += (optimizer.population[0] == asked[1]).all()
    # 9 (1 + s) >= 10 (1 + t), s and t uniform in [-0.2, 0.2]
    s, t = np.random.default_rng(0).uniform(-0.2, 0.2, size=(2, 100_000))
    expected = np.mean(9 * (1 + s) >= 10 * (1 + t))
    assert scipy.stats.binomtest(survived, 200, expected).pvalue > 0.001
