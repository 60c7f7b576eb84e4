"""Draws, means, archive and sizes by hand, a slow oracle, and degenerate cases."""

import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
import scipy.stats

from evolution.run.generation_loop import Evolution
from evolution.search.l_shade import (
    TERMINAL,
    LShade,
    LShadeParameters,
    drawn_crossovers,
    drawn_scales,
    improvement_weights,
    reduced_size,
    two_others,
    weighted_lehmer_mean,
    with_archived,
)
from evolution.search.search_space import SearchSpace
from evolution.settings.config_files import find_config, load_config

SPACE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-5, init_upper=5)


def make(seed=0, space=SPACE, **changes) -> LShade:
    parameters = replace(LShadeParameters(population=12, budget=600), **changes)
    return LShade(parameters, space, np.random.default_rng(seed))


def sphere(genomes: np.ndarray) -> np.ndarray:
    return -np.sum(genomes**2, axis=-1)


def evolve(optimizer: LShade, n_generations: int, fitness=sphere) -> LShade:
    for _ in range(n_generations):
        optimizer.tell(fitness(optimizer.ask()))
    return optimizer


def archive(optimizer: LShade) -> np.ndarray:
    """Genomes in the archive `(n, genes)`."""
    state = optimizer.state()
    return state["archive"][: state["counts"][1]]


# --- Parameters ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"population": 3},
            "^population: expected a whole number from 4 to 100,000, got 3$",
        ),
        ({"archive_rate": -1}, "^archive_rate: expected a number from 0 to 10, got -1"),
        ({"p_best": 0.0}, "^p_best: expected a number above 0, at most 1, got 0.0$"),
        ({"memory": 0}, "^memory: expected a whole number from 1 to 1,000, got 0$"),
        ({"budget": -1}, "^budget: expected a whole number from 0 to "),
        ({"budget": 0}, "^budget: expected a whole number from 1 to .*, got 0$"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


def test_a_run_fills_in_its_evaluations():
    shipped = load_config(find_config("l-shade"))
    for budget, end in ((0, 4), (100_000, 100)):
        parameters = LShadeParameters(budget=budget)
        config = shipped.model_copy(
            update={
                "evaluations": 400,
                "climb": 1.0,
                "steps": 5,
                "trials": 1,
                "optimizer": parameters,
            }
        )
        evolution = Evolution(config, threads=1)
        list(evolution.run())
        assert 390 < evolution.evaluations <= 400
        assert len(evolution.optimizer.population) == pytest.approx(end, abs=2)
        # the configuration says what its user said
        assert evolution.config.optimizer == parameters


# --- Draws ---------------------------------------------------------------------------


def test_crossovers_are_normal_within_0_and_1():
    rng = np.random.default_rng(0)
    memory = np.repeat([0.5, 0.0, 1.0, TERMINAL], 5000)
    half, low, high, terminal = drawn_crossovers(memory, rng).reshape(4, -1)
    assert scipy.stats.kstest((half - 0.5) / 0.1, "norm").pvalue > 0.001
    # the other half is cut off
    assert np.mean(low == 0) == pytest.approx(0.5, abs=0.03)
    assert np.mean(high == 1) == pytest.approx(0.5, abs=0.03)
    assert low.min() == 0 and high.max() == 1
    assert (terminal == 0).all()


def test_scales_are_cauchy_above_0_and_at_most_1():
    rng = np.random.default_rng(0)
    drawn = drawn_scales(np.full(20_000, 0.5), rng)
    assert drawn.min() > 0
    assert drawn.max() == 1
    cauchy = scipy.stats.cauchy(0.5, 0.1)
    below = cauchy.cdf(0)
    # of those that are positive
    assert np.mean(drawn == 1) == pytest.approx(cauchy.sf(1) / (1 - below), abs=0.01)
    inside = drawn[drawn < 1]
    share = (cauchy.cdf(inside) - below) / (cauchy.cdf(1) - below)
    assert scipy.stats.kstest(share, "uniform").pvalue > 0.001
    assert drawn_scales(np.zeros(100), rng).min() > 0


def test_every_pair_of_others_is_equally_likely():
    rng, population, archived = np.random.default_rng(0), 4, 2
    draws = np.array([two_others(population, archived, rng) for _ in range(12_000)])
    for own in range(population):
        # a KeyError is an index that repeats, or the row's own
        counts = {
            (r1, r2): 0
            for r1, r2 in permutations(range(population + archived), 2)
            if r1 < population and own not in (r1, r2)
        }
        assert len(counts) == 3 * 4
        for r1, r2 in draws[:, :, own]:
            counts[int(r1), int(r2)] += 1
        assert scipy.stats.chisquare(list(counts.values())).pvalue > 0.001


# --- Means, archive, sizes -----------------------------------------------------------


def test_means_by_hand():
    values, weights = np.array([0.2, 0.8]), np.array([1.0, 3.0])
    # (0.04 + 3 * 0.64) / (0.2 + 3 * 0.8)
    assert weighted_lehmer_mean(values, weights) == pytest.approx(1.96 / 2.6)
    assert weighted_lehmer_mean(values, 10 * weights) == pytest.approx(1.96 / 2.6)
    assert weighted_lehmer_mean(np.zeros(2), weights) == 0


def test_weights_by_hand():
    inf = np.inf

    def weights(parents, trials):
        return improvement_weights(np.array(parents), np.array(trials)).tolist()

    assert weights([1.0, 2.0, 0.0], [2.0, 6.0, 2.0]) == [0.25, 1, 0.5]
    # who had no fitness counts as who gained most
    assert weights([-inf, 2.0, 0.0], [0.0, 6.0, 1.0]) == [1, 1, 0.25]
    assert weights([-inf, -inf], [0.0, -5.0]) == [1, 1]
    assert weights([0.0, -1e308], [inf, 1e308]) == [1, 1]
    assert weights([0.0], [np.nextafter(0, 1)]) == [1]


def test_the_archive_by_hand():
    old, new = np.array([[1.0], [2.0]]), np.array([[3.0], [4.0], [5.0]])
    rng = np.random.default_rng(0)
    kept = with_archived(old, new, 5, rng)
    assert kept.ravel().tolist() == [1, 2, 3, 4, 5]
    assert with_archived(old[:0], new, 0, rng).shape == (0, 1)
    seen = set()
    for _ in range(200):
        kept = with_archived(old, new, 3, rng).ravel().tolist()
        # the last one always finds a place
        assert len(kept) == 3 and 5 in kept
        seen.add(tuple(kept))
    # 3 fills it; 4 in one of 3 places, then 5 in one of 3
    assert len(seen) == 9
    assert old.ravel().tolist() == [1, 2]


def test_sizes_by_hand():
    sizes = [reduced_size(100, n, 1000) for n in (0, 100, 500, 1000, 5000)]
    # 96 fewer over all
    assert sizes == [100, 90, 52, 4, 4]


# --- A slow oracle -------------------------------------------------------------------


def slow_generations(n_first, budget, n_generations, fitness, seed):
    """Population, fitness, archive and memory: one individual after the other."""
    rng = np.random.default_rng(seed)
    genes, lower, upper = SPACE.genes, SPACE.lower, SPACE.upper
    population = rng.uniform(lower, upper, size=(n_first, genes)).tolist()
    score = [fitness(np.array(x)) for x in population]
    stored: list[list[float]] = []
    m_f, m_cr, k, spent = [0.5] * 6, [0.5] * 6, 0, n_first
    for _ in range(n_generations - 1):
        n = len(population)
        pair = rng.integers(6, size=n)
        normal = rng.standard_normal(n)
        cr = [
            min(max(m_cr[r] + 0.1 * z, 0), 1) for r, z in zip(pair, normal, strict=True)
        ]
        cr = [0 if m_cr[r] == TERMINAL else c for r, c in zip(pair, cr, strict=True)]
        f = [0.0] * n
        while again := [i for i in range(n) if f[i] <= 0]:
            for i, c in zip(again, rng.standard_cauchy(len(again)), strict=True):
                f[i] = m_f[pair[i]] + 0.1 * c
        f = [min(each, 1) for each in f]
        best_first = sorted(range(n), key=lambda i: -score[i])
        pbest = rng.integers(max(round(0.11 * n), 2), size=n)
        r1, r2 = two_others(n, len(stored), rng)
        forced = rng.integers(genes, size=n)
        uniform = rng.random((n, genes))
        both, trials = population + stored, []
        for i in range(n):
            x, p = population[i], population[best_first[pbest[i]]]
            a, b = population[r1[i]], both[r2[i]]
            trial = list(x)
            for j in range(genes):
                if uniform[i, j] < cr[i] or j == forced[i]:
                    v = x[j] + f[i] * (p[j] - x[j]) + f[i] * (a[j] - b[j])
                    v = (x[j] + lower) / 2 if v < lower else v
                    trial[j] = (x[j] + upper) / 2 if v > upper else v
            trials.append(trial)
        told = [fitness(np.array(trial)) for trial in trials]
        spent += n
        won = [i for i in range(n) if told[i] > score[i]]
        beaten = [population[i] for i in won]
        gains = [told[i] - score[i] for i in won]
        population = [
            trials[i] if told[i] >= score[i] else population[i] for i in range(n)
        ]
        score = [max(pair) for pair in zip(told, score, strict=True)]
        capacity = round(2.6 * n)
        free = capacity - len(stored)
        stored = stored + beaten[:free]
        for place, x in zip(
            rng.integers(capacity, size=len(beaten[free:])), beaten[free:], strict=True
        ):
            stored[place] = x
        if won:
            sums = [
                sum(g * values[i] ** power for g, i in zip(gains, won, strict=True))
                for values in (f, cr)
                for power in (1, 2)
            ]
            m_f[k] = sums[1] / sums[0]
            over = m_cr[k] == TERMINAL or max(cr[i] for i in won) == 0
            m_cr[k] = TERMINAL if over else sums[3] / sums[2]
            k = (k + 1) % 6
        size = max(round((4 - n_first) / budget * spent + n_first), 4)
        if size < n:
            best = sorted(range(n), key=lambda i: -score[i])[:size]
            population = [population[i] for i in sorted(best)]
            score = [score[i] for i in sorted(best)]
            capacity = round(2.6 * size)
            if len(stored) > capacity:
                stay = rng.permutation(len(stored))[:capacity]
                stored = [stored[i] for i in sorted(stay)]
    return population, score, stored, m_f, m_cr


@pytest.mark.parametrize("plateau", [1, 4])
def test_fast_is_slow(plateau):
    # rounding makes plateaus, so that ties of parent and trial happen
    def fitness(genomes):
        return np.round(plateau * sphere(genomes)) / plateau

    optimizer = evolve(make(seed=5, population=20, budget=500), 45, fitness)
    slow = slow_generations(20, 500, 45, fitness, seed=5)
    assert len(optimizer.population) < 10
    np.testing.assert_allclose(optimizer.population, slow[0], rtol=1e-9)
    np.testing.assert_array_equal(optimizer.fitness, slow[1])
    np.testing.assert_allclose(archive(optimizer), slow[2], rtol=1e-9)
    state = optimizer.state()
    np.testing.assert_allclose(state["scales"], slow[3], rtol=1e-9)
    np.testing.assert_allclose(state["crossovers"], slow[4], rtol=1e-9)


# --- What is learned -----------------------------------------------------------------


def test_it_turns_to_a_narrow_oblique_valley():
    def valley(genomes):
        across = genomes[:, 0] - genomes[:, 1]
        return -1e4 * across**2 + sphere(genomes)

    assert evolve(make(population=40, budget=8000), 400, valley).fitness.max() > -1e-6


def test_a_tie_takes_the_parents_place_and_teaches_nothing():
    optimizer = evolve(make(), 1, lambda genomes: np.zeros(len(genomes)))
    before, trials = optimizer.state(), optimizer.ask()
    to_beat = optimizer.to_beat()
    assert (to_beat < 0).all()
    assert (np.nextafter(to_beat, 1) == 0).all()
    optimizer.tell(np.where(np.arange(12) < 6, 0, to_beat))
    np.testing.assert_array_equal(optimizer.population[:6], trials[:6])
    np.testing.assert_array_equal(optimizer.population[6:], before["population"][6:])
    assert (optimizer.fitness == 0).all()
    assert len(archive(optimizer)) == 0
    for key in ("scales", "crossovers"):
        np.testing.assert_array_equal(optimizer.state()[key], before[key])


def test_crossovers_of_0_end_in_one_forced_gene_for_ever():
    optimizer = evolve(make(memory=1), 2)
    state = optimizer.state()
    optimizer.restore({**state, "crossovers": np.array([TERMINAL])})
    for _ in range(5):
        parents, trials = optimizer.population, optimizer.ask()
        assert ((trials != parents).sum(axis=1) <= 1).all()
        optimizer.tell(sphere(trials))
        assert optimizer.state()["crossovers"].tolist() == [TERMINAL]


def test_the_smallest_population_without_archive_searches():
    optimizer = make(population=4, budget=1, archive_rate=0)
    before = evolve(optimizer, 1).fitness.max()
    assert evolve(optimizer, 50).fitness.max() > before
    assert optimizer.population.shape == (4, 3)
    assert archive(optimizer).shape == (0, 3)


def test_who_is_dropped_is_worst():
    # the first population is not reduced, whatever the budget
    optimizer = evolve(make(population=12, budget=24), 1)
    assert len(optimizer.population) == 12
    parents, stored, trials = optimizer.population, optimizer.fitness, optimizer.ask()
    told = sphere(trials)
    optimizer.tell(told)
    survivors = np.where((told >= stored)[:, np.newaxis], trials, parents)
    kept = np.sort(np.argsort(-np.maximum(told, stored), kind="stable")[:4])
    np.testing.assert_array_equal(optimizer.population, survivors[kept])


def test_what_is_judged_anew_is_paid_and_shrinks_later():
    optimizer = evolve(make(budget=240), 2)
    n, spent = optimizer.next_size(), int(optimizer.state()["counts"][2])
    optimizer.judge_anew(np.arange(n))
    assert optimizer.fitness.tolist() == list(range(n))
    assert optimizer.next_size() == n
    evolve(optimizer, 1)
    assert optimizer.state()["counts"][2] == spent + 2 * n
    assert len(optimizer.population) == reduced_size(12, spent + 2 * n, 240) < n


# --- States --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "counts", [(3, 0, 9, 0), (13, 0, 9, 0), (4, 11, 9, 0), (4, 0, -1, 0), (4, 0, 9, 6)]
)
def test_counts_that_cannot_be_are_refused_and_leave_no_trace(counts):
    optimizer, good = evolve(make(), 3), evolve(make(seed=1), 9).state()
    before = optimizer.state()
    with pytest.raises(ValueError, match=r"'counts': expected .*, got \["):
        optimizer.restore({**good, "counts": np.array(counts)})
    for key, array in optimizer.state().items():
        np.testing.assert_array_equal(array, before[key])


def test_numbers_do_not_depend_on_the_order_of_sums():
    rng = np.random.default_rng(0)
    values, weights = rng.random(1000), rng.random(1000)
    order = rng.permutation(1000)
    means = [weighted_lehmer_mean(values[i], weights[i]) for i in (slice(None), order)]
    assert means[0] == means[1]
    assert means[0] == pytest.approx(
        math.fsum(weights * values**2) / math.fsum(weights * values)
    )
