"""Operators worked by hand, a slow oracle, degenerate cases, and scipy's version."""

import itertools
from functools import cache

import numpy as np
import pytest
import scipy.optimize
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from evolution.search.bounds import BOUNDS_RULES
from evolution.search.differential_evolution import (
    STRATEGIES,
    DifferentialEvolution,
    DifferentialEvolutionParameters,
    binomial_crossover,
    distinct_parents,
)
from evolution.search.search_space import SearchSpace

# Neither a slow machine nor a lucky draw decides a test.
steady = settings(deadline=None, derandomize=True)

SPACE = SearchSpace(genes=4, lower=-5, upper=5, init_lower=-5, init_upper=5)
GENOMES = np.array([[0.0, 0.0], [1.0, 10.0], [2.0, 30.0], [4.0, 70.0]])
PARENTS = np.array([[1, 2, 3], [3, 2, 0], [0, 3, 1], [2, 0, 1]])


def make(strategy="rand", seed=0, space=SPACE, **changes) -> DifferentialEvolution:
    values = {"population": 8, "scale": 0.8, "crossover": 0.9} | changes
    parameters = DifferentialEvolutionParameters(strategy=strategy, **values)
    return DifferentialEvolution(parameters, space, np.random.default_rng(seed))


def sphere(genomes: np.ndarray) -> np.ndarray:
    return -np.sum(genomes**2, axis=-1)


# --- Parameters ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"strategy": "fast"}, "^unknown strategy 'fast'; available: best, rand$"),
        (
            {"population": 3},
            "^population: expected a whole number from 4 to 100,000, got 3$",
        ),
        ({"scale": -0.1}, "^scale: expected a number from 0 to 2, got -0.1$"),
        ({"scale": 2.1}, "^scale: "),
        ({"scale": np.nan}, "^scale: "),
        ({"crossover": 1.1}, "^crossover: expected a number from 0 to 1, got 1.1$"),
        ({"crossover": -0.1}, "^crossover: "),
        (
            {"reevaluate_best": 9},
            "^reevaluate_best: expected 0 to population = 8, got 9$",
        ),
        ({"reevaluate_best": -1}, "^reevaluate_best: expected a whole number from 0 "),
        (
            {"reevaluate_best": 1, "reevaluate_parents": True},
            "^reevaluate_best: expected 0 together with reevaluate_parents, got 1$",
        ),
        (
            {"bounds_rule": "wrap"},
            "^unknown bounds rule 'wrap'; "
            "available: midpoint, none, clip, reflect, reinit$",
        ),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


# --- Parents and mutants -------------------------------------------------------------


def test_every_triple_of_parents_is_equally_likely():
    rng = np.random.default_rng(0)
    draws = np.stack([distinct_parents(5, rng) for _ in range(4000)])
    for i in range(5):
        others = [j for j in range(5) if j != i]
        triples = list(itertools.permutations(others, 3))
        counts = {triple: 0 for triple in triples}
        for drawn in draws[:, i]:
            # A KeyError here is a parent that repeats or is the individual itself.
            counts[tuple(drawn.tolist())] += 1
        assert scipy.stats.chisquare(list(counts.values())).pvalue > 0.001


def test_smallest_population_uses_all_the_others():
    drawn = distinct_parents(4, np.random.default_rng(0))
    assert np.sort(drawn, axis=1).tolist() == [
        [1, 2, 3],
        [0, 2, 3],
        [0, 1, 3],
        [0, 1, 2],
    ]


def test_rand_mutants_by_hand():
    mutants = STRATEGIES["rand"](GENOMES, 2, PARENTS, 0.5)
    # x_r1 + (x_r2 - x_r3) / 2
    assert mutants.tolist() == [[0, -10], [5, 85], [1.5, 30], [1.5, 25]]


def test_best_mutants_by_hand():
    mutants = STRATEGIES["best"](GENOMES, 2, PARENTS, 0.5)
    # (2, 30) + (x_r2 - x_r3) / 2
    assert mutants.tolist() == [[1, 10], [3, 45], [3.5, 60], [1.5, 25]]


# --- Crossover -----------------------------------------------------------------------


def test_crossover_by_hand():
    parents, mutants = np.zeros((3, 4)), np.ones((3, 4))
    trials = binomial_crossover(parents, mutants, 0.5, np.random.default_rng(3))
    same = np.random.default_rng(3)
    forced = same.integers(4, size=3)
    rand = same.random((3, 4))
    for i, j in itertools.product(range(3), range(4)):
        assert trials[i, j] == (1 if rand[i, j] < 0.5 or j == forced[i] else 0)


def test_crossover_0_takes_one_gene_and_each_equally_often():
    parents, mutants = np.zeros((4000, 4)), np.ones((4000, 4))
    trials = binomial_crossover(parents, mutants, 0.0, np.random.default_rng(0))
    assert np.all(trials.sum(axis=1) == 1)
    assert scipy.stats.chisquare(trials.sum(axis=0)).pvalue > 0.001


def test_crossover_1_takes_every_gene():
    parents, mutants = np.zeros((100, 4)), np.ones((100, 4))
    trials = binomial_crossover(parents, mutants, 1.0, np.random.default_rng(0))
    assert np.all(trials == 1)


def test_crossover_rate_counts_the_forced_gene():
    parents, mutants = np.zeros((20_000, 4)), np.ones((20_000, 4))
    trials = binomial_crossover(parents, mutants, 0.3, np.random.default_rng(0))
    # 1/4 forced, the rest at 0.3; 5 standard errors.
    assert abs(trials.mean() - (0.25 + 0.75 * 0.3)) < 5 * 0.5 / np.sqrt(80_000)


# --- Bounds --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("none", [-9, -1, 0.5, 2, 5, 12]),
        ("clip", [-1, -1, 0.5, 2, 2, 2]),
        ("midpoint", [-0.5, -1, 0.5, 2, 2, 1]),
        # -9 -> 7 -> -3 -> 1;  5 -> -1;  12 -> -8 -> 6 -> -2 -> 0
        ("reflect", [1, -1, 0.5, 2, -1, 0]),
    ],
)
def test_bounds_rules_by_hand(rule, expected):
    trial = np.array([[-9, -1, 0.5, 2, 5, 12]])
    parent = np.array([[0, 1, 1, 1, 2, 0.0]])
    rng = np.random.default_rng(0)
    assert BOUNDS_RULES[rule](trial, parent, -1.0, 2.0, rng).tolist() == [expected]


def test_reinit_is_uniform_and_only_outside():
    trial = np.full((5000, 3), [-9.0, 0.25, 9.0])
    rng = np.random.default_rng(0)
    moved = BOUNDS_RULES["reinit"](trial, np.zeros_like(trial), -1.0, 2.0, rng)
    assert np.all(moved[:, 1] == 0.25)
    uniform = scipy.stats.uniform(-1, 3).cdf
    for column in (0, 2):
        assert scipy.stats.kstest(moved[:, column], uniform).pvalue > 0.001


@steady
@given(
    trial=st.floats(-100, 100),
    share=st.floats(0, 1),
    lower=st.floats(-10, 10),
    width=st.floats(0.1, 20),
    rule=st.sampled_from([rule for rule in BOUNDS_RULES if rule != "none"]),
)
def test_every_rule_ends_inside_and_leaves_the_inside_alone(
    trial, share, lower, width, rule
):
    upper = lower + width
    parent = np.array([min(max(lower + share * width, lower), upper)])
    rng = np.random.default_rng(0)
    (kept,) = BOUNDS_RULES[rule](np.array([trial]), parent, lower, upper, rng)
    assert lower <= kept <= upper
    if lower <= trial <= upper:
        assert kept == trial


@steady
@given(trial=st.floats(-100, 100), lower=st.floats(-10, 10), width=st.floats(0.5, 20))
def test_reflect_is_mirroring_until_inside(trial, lower, width):
    upper = lower + width
    rng = np.random.default_rng(0)
    (fast,) = BOUNDS_RULES["reflect"](np.array([trial]), np.zeros(1), lower, upper, rng)
    slow = trial
    while not lower <= slow <= upper:
        slow = 2 * lower - slow if slow < lower else 2 * upper - slow
    # Rounding may put one of the two on the other side of a bound.
    assert fast == pytest.approx(slow, abs=1e-9)


def test_rule_none_lets_genomes_leave():
    optimizer = make("rand", bounds_rule="none", population=20)
    for _ in range(30):
        optimizer.tell(optimizer.ask().sum(axis=1))
    assert optimizer.population.max() > 5


# --- One generation, slowly ----------------------------------------------------------


def slow_generations(strategy, n, scale, crossover, n_generations, fitness, seed):
    """Algorithm 1 with loops, midpoint rule, given the optimiser's own draws."""
    rng = np.random.default_rng(seed)
    genes, lower, upper = SPACE.genes, SPACE.lower, SPACE.upper
    old = rng.uniform(lower, upper, size=(n, genes)).tolist()
    score = [fitness(np.array(x)) for x in old]
    for _ in range(n_generations - 1):
        keys = rng.random((n, n))
        forced = rng.integers(genes, size=n)
        rand = rng.random((n, genes))
        new, new_score = [], []
        best = max(range(n), key=lambda k: score[k])
        for i in range(n):
            others = [k for k in range(n) if k != i]
            r1, r2, r3 = sorted(others, key=lambda k: keys[i, k])[:3]
            if strategy == "best":
                r1 = best
            y = list(old[i])
            for j in range(genes):
                if rand[i, j] < crossover or j == forced[i]:
                    y[j] = old[r1][j] + scale * (old[r2][j] - old[r3][j])
                    if y[j] < lower:
                        y[j] = (old[i][j] + lower) / 2
                    elif y[j] > upper:
                        y[j] = (old[i][j] + upper) / 2
            trial_score = fitness(np.array(y))
            better = trial_score > score[i]
            new.append(y if better else old[i])
            new_score.append(trial_score if better else score[i])
        old, score = new, new_score
    return np.array(old), np.array(score)


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("crossover", [0.0, 0.5, 1.0])
def test_fast_is_slow(strategy, crossover):
    # Rounding makes plateaus, so that ties of parent and trial and of bests happen.
    def fitness(genomes):
        return np.round(sphere(genomes) / 4)

    optimizer = make(strategy, seed=5, population=9, crossover=crossover)
    for _ in range(12):
        optimizer.tell(fitness(optimizer.ask()))
    slow = slow_generations(strategy, 9, 0.8, crossover, 12, fitness, seed=5)
    np.testing.assert_array_equal(optimizer.population, slow[0])
    np.testing.assert_array_equal(optimizer.fitness, slow[1])


# --- Selection and degenerate cases --------------------------------------------------


def test_a_tie_keeps_the_parent():
    optimizer = make()
    initial = optimizer.ask()
    optimizer.tell(np.zeros(8))
    optimizer.ask()
    optimizer.tell([0, 0, 0, np.nextafter(0, 1), -1, 0, np.nan, -np.inf])
    changed = np.any(optimizer.population != initial, axis=1)
    assert np.flatnonzero(changed).tolist() == [3]
    assert optimizer.fitness.tolist() == [0, 0, 0, np.nextafter(0, 1), 0, 0, 0, 0]


def test_scale_0_with_best_and_crossover_1_asks_the_best():
    optimizer = make("best", scale=0.0, crossover=1.0)
    initial = optimizer.ask()
    # Of the equal bests the first.
    optimizer.tell([1, 2, 3, 9, 9, 4, 5, 6])
    np.testing.assert_array_equal(optimizer.ask(), np.tile(initial[3], (8, 1)))


def test_scale_0_with_rand_and_crossover_1_asks_other_members():
    optimizer = make("rand", scale=0.0, crossover=1.0)
    initial = optimizer.ask()
    optimizer.tell(sphere(initial))
    same = np.all(optimizer.ask()[:, np.newaxis] == initial, axis=-1)
    assert np.all(same.sum(axis=1) == 1)
    assert not np.diag(same).any()


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_crossover_0_changes_one_gene(strategy):
    optimizer = make(strategy, seed=2, crossover=0.0, scale=0.5, population=50)
    initial = optimizer.ask()
    optimizer.tell(sphere(initial))
    # The best too: it is its own base, but r2 and r3 differ.
    assert np.all((optimizer.ask() != initial).sum(axis=1) == 1)


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("rule", BOUNDS_RULES)
def test_identical_individuals_stay_identical(strategy, rule):
    point = SearchSpace(genes=4, lower=-5, upper=5, init_lower=2, init_upper=2)
    optimizer = make(strategy, space=point, bounds_rule=rule)
    for _ in range(5):
        genomes = optimizer.ask()
        assert np.all(genomes == 2)
        optimizer.tell(np.arange(8))


def test_reevaluated_parents_are_asked_first_and_judged_afresh():
    optimizer = make(reevaluate_parents=True)
    assert optimizer.next_size() == 8
    initial = optimizer.ask()
    optimizer.tell(np.full(8, 100.0))
    assert optimizer.next_size() == 16
    asked = optimizer.ask()
    np.testing.assert_array_equal(asked[:8], initial)
    # The lucky 100 is forgotten; trials of odd rows are better, of even rows no better.
    optimizer.tell([*range(8), 0, 2, 2, 4, 4, 6, 6, 8])
    np.testing.assert_array_equal(optimizer.population[0::2], initial[0::2])
    np.testing.assert_array_equal(optimizer.population[1::2], asked[9::2])
    assert optimizer.fitness.tolist() == [0, 2, 2, 4, 4, 6, 6, 8]


# --- The best evaluated again --------------------------------------------------------


def test_the_best_are_asked_again_and_have_means():
    optimizer = make(reevaluate_best=2)
    initial = optimizer.ask()
    optimizer.tell([5, 90, 1, 2, 60, 3, 4, 0])
    assert optimizer.next_size() == 10
    asked = optimizer.ask()
    np.testing.assert_array_equal(asked[:2], initial[[1, 4]])
    # only they and their trials may be told anything
    free = [0, 1, 3, 6]
    expected = np.array([0, 0, 5, 0, 1, 2, 0, 3, 4, 0.0])
    expected[free] = -np.inf
    assert optimizer.to_beat().tolist() == expected.tolist()
    # means of 50 and 62: a trial of 51 wins, one of 62 does not
    optimizer.tell([10, 64, 0, 51, 1, 2, 62, 3, 4, 0.5])
    assert optimizer.fitness.tolist() == [5, 51, 1, 2, 62, 3, 4, 0.5]
    np.testing.assert_array_equal(optimizer.population[1], asked[3])
    np.testing.assert_array_equal(optimizer.population[4], initial[4])
    counts = optimizer.state()["evaluations"]
    assert counts.tolist() == [1, 1, 1, 1, 2, 1, 1, 1]
    # the third evaluation of the one, the second of the other
    optimizer.ask()
    optimizer.tell([53, 32, *[-1] * 8])
    assert optimizer.fitness.tolist() == [5, 52, 1, 2, 52, 3, 4, 0.5]


def test_without_it_the_state_is_what_it_was():
    assert "evaluations" not in make().state()
    assert "evaluations" not in make(reevaluate_parents=True).state()
    assert "evaluations" in make(reevaluate_best=1).state()


def bias_of_the_best(seed: int, **changes) -> float:
    """Stored minus true fitness of the stored best, after 60 noisy generations."""
    noise = np.random.default_rng(seed)
    optimizer = make("best", seed, population=20, scale=0.5, **changes)
    for _ in range(60):
        genomes = optimizer.ask()
        optimizer.tell(sphere(genomes) + noise.normal(0, 3, len(genomes)))
    best = np.argmax(optimizer.fitness)
    return optimizer.fitness[best] - sphere(optimizer.population[best])


def test_under_noise_the_best_is_believed_less_where_it_is_evaluated_again():
    seeds = range(20)
    believed = np.mean([bias_of_the_best(seed) for seed in seeds])
    again = np.mean([bias_of_the_best(seed, reevaluate_best=3) for seed in seeds])
    # three standard deviations of the noise; what is left is that of newcomers, who
    # have been evaluated once
    assert believed > 9
    assert again < 0.7 * believed


# --- Against scipy, in distribution --------------------------------------------------

N_SEEDS, N_GENERATIONS, N_POPULATION, N_GENES = 40, 30, 30, 5
BOX = SearchSpace(genes=N_GENES, lower=-5, upper=5, init_lower=-5, init_upper=5)


def rosenbrock(genomes: np.ndarray) -> np.ndarray:
    """Cost `(...)` of genomes `(..., genes)`: coupled genes, a curved valley."""
    a, b = genomes[..., :-1], genomes[..., 1:]
    return np.sum(100 * (b - a**2) ** 2 + (1 - a) ** 2, axis=-1)


def corner(genomes: np.ndarray) -> np.ndarray:
    """Cost `(...)` with its minimum near a corner: the bounds rule decides."""
    return np.sum((genomes - 4.5) ** 2, axis=-1)


COSTS = {"rosenbrock": rosenbrock, "corner": corner}


@cache
def our_log_costs(cost, strategy, crossover=0.9, rule="reinit"):
    """Log of the best cost of each seed `(N_SEEDS,)`, and the initial populations."""
    costs, initials = [], []
    for seed in range(N_SEEDS):
        changes = {"crossover": crossover, "bounds_rule": rule}
        optimizer = make(strategy, seed, BOX, population=N_POPULATION, **changes)
        initials.append(optimizer.population)
        for _ in range(N_GENERATIONS + 1):
            optimizer.tell(-COSTS[cost](optimizer.ask()))
        costs.append(-optimizer.fitness.max())
    return np.log(costs), initials


def scipy_log_costs(cost, strategy, initials):
    """The same from scipy: other draws, same initial genomes, as many evaluations."""
    costs = []
    for seed, initial in enumerate(initials):
        # It picks parents and forced gene as Algorithm 1 does and redraws genes outside
        # uniformly ('reinit'). It accepts ties, which these functions do not produce.
        result = scipy.optimize.differential_evolution(
            lambda x: COSTS[cost](x.T),
            bounds=[(BOX.lower, BOX.upper)] * N_GENES,
            strategy=f"{strategy}1bin",
            init=initial,
            mutation=0.8,
            recombination=0.9,
            maxiter=N_GENERATIONS,
            tol=0,
            polish=False,
            updating="deferred",
            vectorized=True,
            rng=1000 + seed,
        )
        assert result.nit == N_GENERATIONS
        costs.append(result.fun)
    return np.log(costs)


@pytest.fixture(scope="module")
def scipys():
    """Scipy's log costs `(N_SEEDS,)` by cost and strategy, at F 0.8 and CR 0.9."""
    _, initials = our_log_costs("corner", "rand")
    return {
        (cost, strategy): scipy_log_costs(cost, strategy, initials)
        for cost in COSTS
        for strategy in STRATEGIES
    }


def same_distribution(a: np.ndarray, b: np.ndarray) -> float:
    """The p-value of two samples having one distribution (Kolmogorov-Smirnov)."""
    return scipy.stats.kstest(a, b).pvalue


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("strategy", STRATEGIES)
def test_scipy_finds_as_good_a_best(cost, strategy, scipys):
    ours, _ = our_log_costs(cost, strategy)
    assert same_distribution(ours, scipys[cost, strategy]) > 0.01
    assert scipy.stats.mannwhitneyu(ours, scipys[cost, strategy]).pvalue > 0.01


@pytest.mark.parametrize(
    ("cost", "strategy", "wrong"),
    [
        ("rosenbrock", "best", {"strategy": "rand"}),
        ("rosenbrock", "rand", {"strategy": "best"}),
        ("corner", "best", {"strategy": "best", "rule": "midpoint"}),
        ("corner", "rand", {"strategy": "rand", "rule": "midpoint"}),
        ("corner", "rand", {"strategy": "rand", "crossover": 0.6}),
    ],
)
def test_the_comparison_tells_a_wrong_algorithm(cost, strategy, wrong, scipys):
    ours, _ = our_log_costs(cost, **wrong)
    assert same_distribution(ours, scipys[cost, strategy]) < 1e-3
