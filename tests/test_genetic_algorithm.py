"""Operators worked by hand or counted, a slow oracle, and degenerate cases."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from evolution.search.genetic_algorithm import (
    GeneticAlgorithm,
    GeneticAlgorithmParameters,
    binary_of_gray,
    decode,
    mutate,
    one_point_crossover,
    tournament_winners,
    two_point_crossover,
)
from evolution.search.search_space import SearchSpace

# Neither a slow machine nor a lucky draw decides a test.
steady = settings(deadline=None, derandomize=True)

SPACE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-5, init_upper=5)


def make(seed=0, space=SPACE, **changes) -> GeneticAlgorithm:
    parameters = GeneticAlgorithmParameters(**changes)
    return GeneticAlgorithm(parameters, space, np.random.default_rng(seed))


def sphere(genomes: np.ndarray) -> np.ndarray:
    return -np.sum(genomes**2, axis=-1)


def chromosome(*genes: str) -> np.ndarray:
    return np.array([bit == "1" for bit in "".join(genes)])


# --- Parameters ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"population": 1},
            "^population: expected a whole number from 2 to 100,000, got 1$",
        ),
        ({"bits": 0}, "^bits: expected a whole number from 1 to 32, got 0$"),
        ({"bits": 33}, "^bits: expected a whole number from 1 to 32, got 33$"),
        (
            {"tournament": 0},
            "^tournament: expected a whole number from 1 to 10,000, got 0$",
        ),
        ({"crossover": 1.1}, "^crossover: expected a number from 0 to 1, got 1.1$"),
        ({"mutation": np.nan}, "^mutation: expected a number from 0 to 1, got nan$"),
        ({"elites": -1}, "^elites: expected a whole number from 0 to .*, got -1$"),
        ({"elites": 100}, "^elites: expected 0 to population - 1 = 99, got 100$"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


def test_spaces_it_cannot_search_are_refused():
    one_gene = SearchSpace(genes=1, lower=-5, upper=5, init_lower=-5, init_upper=5)
    with pytest.raises(ValueError, match="at least 2 bits"):
        make(space=one_gene, bits=1)
    narrow = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-1, init_upper=1)
    with pytest.raises(ValueError, match=r"initial range \[-5, 5\] .*got \[-1, 1\]"):
        make(space=narrow)


# --- Decoding ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bits", "level"),
    [
        ("00000000", 0),
        ("00000001", 1),
        ("00000010", 2),
        ("01111111", 127),
        ("10000000", 128),
        ("10100101", 165),
        ("11111111", 255),
    ],
)
def test_decode_8_bits_by_hand(bits, level):
    # From 0 to 255 a level is 1; from -5 to 5 it is 10 / 255.
    assert decode(chromosome(bits), 8, 0.0, 255.0).tolist() == pytest.approx([level])
    expected = [-5 + level * 10 / 255]
    assert decode(chromosome(bits), 8, -5.0, 5.0).tolist() == pytest.approx(expected)


def test_decode_reads_gene_by_gene():
    genes = chromosome("00", "01", "10", "11")
    assert decode(genes, 2, 0.0, 3.0).tolist() == [0, 1, 2, 3]
    both = decode(np.stack([genes, ~genes]), 2, 0.0, 3.0)
    assert both.tolist() == [[0, 1, 2, 3], [3, 2, 1, 0]]


@steady
@given(
    bits=st.integers(1, 32),
    pattern=st.integers(0, 2**32 - 1),
    lower=st.floats(-10, 10),
    width=st.floats(0.1, 20),
)
def test_decode_is_linear_with_exact_ends(bits, pattern, lower, width):
    upper = lower + width
    level = pattern % 2**bits
    text = f"{level:0{bits}b}"
    ends = decode(chromosome("0" * bits, "1" * bits), bits, lower, upper)
    assert ends.tolist() == [lower, upper]
    (value,) = decode(chromosome(text), bits, lower, upper)
    assert lower <= value <= upper
    assert value == pytest.approx(lower + level / (2**bits - 1) * width, abs=1e-12)


def test_initial_bits_are_fair_and_genomes_uniform():
    genomes = make(population=5000).ask()
    levels = np.round((genomes + 5) / (10 / 255)).astype(int).ravel()
    assert scipy.stats.chisquare(np.bincount(levels, minlength=256)).pvalue > 0.001


# --- Tournaments ---------------------------------------------------------------------


def test_tournament_with_known_draws():
    fitness = np.array([3.0, 1.0, 2.0, 3.0])
    winners = tournament_winners(fitness, 50, 3, np.random.default_rng(0))
    contestants = np.random.default_rng(0).integers(4, size=(50, 3))
    for winner, drawn in zip(winners, contestants.tolist(), strict=True):
        # max returns the first of equals, as it should be here.
        assert winner == max(drawn, key=lambda i: fitness[i])


@pytest.mark.parametrize("size", [1, 2, 5])
def test_tournament_pressure_is_the_theorys(size):
    n, n_tournaments = 6, 60_000
    fitness = np.array([0.1, 0.5, 0.3, 0.6, 0.2, 0.4])
    winners = tournament_winners(fitness, n_tournaments, size, np.random.default_rng(0))
    # The k-th worst wins if all are among the k worst, but not all among the k - 1.
    rank = np.argsort(np.argsort(fitness)) + 1
    expected = (rank / n) ** size - ((rank - 1) / n) ** size
    counts = np.bincount(winners, minlength=n)
    assert scipy.stats.chisquare(counts, expected * n_tournaments).pvalue > 0.001


def test_equals_win_equally_often():
    fitness = np.full(5, -np.inf)
    winners = tournament_winners(fitness, 20_000, 5, np.random.default_rng(0))
    assert scipy.stats.chisquare(np.bincount(winners, minlength=5)).pvalue > 0.001


# --- Crossover -----------------------------------------------------------------------


def test_crossover_with_known_draws():
    parents = np.stack([chromosome("00000000"), chromosome("11111111")] * 3)
    children = one_point_crossover(parents, 0.5, np.random.default_rng(8))
    same = np.random.default_rng(8)
    points, crossed = same.integers(1, 8, size=3), same.random(3) < 0.5
    assert set(crossed.tolist()) == {True, False}
    for pair, (point, swap) in enumerate(zip(points, crossed, strict=True)):
        point = point if swap else 8
        first = chromosome("0" * point, "1" * (8 - point))
        assert children[2 * pair].tolist() == first.tolist()
        assert children[2 * pair + 1].tolist() == (~first).tolist()


def test_crossover_points_are_uniform_and_pairs_crossed_at_the_rate():
    n_pairs, length = 20_000, 6
    parents = np.tile([[False] * length, [True] * length], (n_pairs, 1))
    children = one_point_crossover(parents, 0.85, np.random.default_rng(0))
    # Ones in the first child: length - point if crossed, else none.
    n_ones = np.bincount(children[0::2].sum(axis=1), minlength=length + 1)
    assert n_ones[length] == 0
    expected = n_pairs * np.array([0.15] + [0.85 / 5] * 5)
    assert scipy.stats.chisquare(n_ones[:length], expected).pvalue > 0.001


@steady
@given(st.integers(0, 1000))
def test_crossover_keeps_the_bits_of_a_pair_in_their_places(seed):
    rng = np.random.default_rng(seed)
    parents = rng.integers(2, size=(10, 7)).astype(bool)
    before = parents.copy()
    children = one_point_crossover(parents, 0.85, rng)
    np.testing.assert_array_equal(parents, before)
    before, after = (a[0::2].astype(int) + a[1::2] for a in (parents, children))
    np.testing.assert_array_equal(after, before)


# --- Mutation ------------------------------------------------------------------------


def test_mutation_with_known_draws():
    before = np.random.default_rng(1).integers(2, size=(4, 9)).astype(bool)
    after = mutate(before, 0.3, np.random.default_rng(0))
    flipped = np.random.default_rng(0).random((4, 9)) < 0.3
    np.testing.assert_array_equal(before != after, flipped)


def test_mutation_flips_zeros_and_ones_at_the_rate():
    before = np.tile([True, False], (500, 400))
    flipped = mutate(before, 0.01, np.random.default_rng(0)) != before
    for half in (flipped[:, 0::2], flipped[:, 1::2]):
        assert scipy.stats.binomtest(int(half.sum()), half.size, 0.01).pvalue > 0.001


def test_mutation_0_and_1():
    before = np.random.default_rng(1).integers(2, size=(4, 9)).astype(bool)
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(mutate(before, 0.0, rng), before)
    np.testing.assert_array_equal(mutate(before, 1.0, rng), ~before)


# --- One generation, slowly ----------------------------------------------------------


def slow_generations(n, bits, tournament, elites, n_generations, fitness, seed):
    """The genomes asked last, with loops, given the optimiser's own draws."""
    rng = np.random.default_rng(seed)
    length = SPACE.genes * bits

    def genome(x):
        texts = ["".join(map(str, x[k : k + bits])) for k in range(0, length, bits)]
        shares = [int(text, 2) / (2**bits - 1) for text in texts]
        return [SPACE.lower * (1 - s) + SPACE.upper * s for s in shares]

    old = rng.integers(2, size=(n, length)).tolist()
    for _ in range(n_generations - 1):
        score = [fitness(np.array(genome(x))) for x in old]
        n_pairs = -(-(n - elites) // 2)
        contestants = rng.integers(n, size=(2 * n_pairs, tournament)).tolist()
        points = rng.integers(1, length, size=n_pairs)
        crossed = rng.random(n_pairs) < 0.85
        flips = rng.random((n - elites, length)) < 0.01
        winners = [max(drawn, key=lambda k: score[k]) for drawn in contestants]
        children = []
        for pair in range(n_pairs):
            a, b = old[winners[2 * pair]], old[winners[2 * pair + 1]]
            if crossed[pair]:
                cut = points[pair]
                a, b = a[:cut] + b[cut:], b[:cut] + a[cut:]
            children += [a, b]
        ranking = sorted(range(n), key=lambda k: score[k], reverse=True)
        new = [old[k] for k in ranking[:elites]]
        for child, flip in zip(children[: n - elites], flips, strict=True):
            new.append([1 - x if f else x for x, f in zip(child, flip, strict=True)])
        old = new
    return np.array([genome(x) for x in old])


@pytest.mark.parametrize(("n", "elites"), [(10, 0), (11, 0), (10, 1), (11, 4)])
@pytest.mark.parametrize("bits", [1, 8])
def test_fast_is_slow(n, elites, bits):
    # Rounding makes plateaus, so that ties happen.
    def fitness(genomes):
        return np.round(sphere(genomes) / 10)

    optimizer = make(3, population=n, bits=bits, elites=elites)
    for _ in range(8):
        optimizer.tell(fitness(optimizer.ask()))
    slow = slow_generations(n, bits, 5, elites, 8, fitness, seed=3)
    np.testing.assert_array_equal(optimizer.population, slow)
    np.testing.assert_array_equal(optimizer.fitness, fitness(slow))


# --- Degenerate cases ----------------------------------------------------------------


def test_without_crossover_and_mutation_parents_return():
    optimizer = make(crossover=0.0, mutation=0.0)
    initial = optimizer.ask()
    optimizer.tell(sphere(initial))
    known = {tuple(genome) for genome in initial.tolist()}
    assert {tuple(genome) for genome in optimizer.ask().tolist()} <= known


def test_identical_individuals_stay_identical_without_mutation():
    optimizer = make(population=9, mutation=0.0)
    optimizer.tell(sphere(optimizer.ask()))
    state = optimizer.state()
    state["chromosomes"][:] = state["chromosomes"][4]
    optimizer.restore(state)
    before = optimizer.population
    for _ in range(5):
        np.testing.assert_array_equal(optimizer.ask(), before)
        optimizer.tell(np.arange(9))


def test_elites_return_unchanged_the_best_first_and_are_asked_again():
    optimizer = make(population=7, elites=3, mutation=1.0)
    initial = optimizer.ask()
    optimizer.tell([0, 5, np.nan, 9, 5, 1, -np.inf])
    asked = optimizer.ask()
    np.testing.assert_array_equal(asked[:3], initial[[3, 1, 4]])
    # On a second look they are the worst, and gone.
    optimizer.tell([-1, -1, -1, 0, 0, 0, 0])
    np.testing.assert_array_equal(optimizer.ask()[:3], asked[3:6])


def test_nobody_survives_without_elites():
    optimizer = make(mutation=1.0, crossover=0.0)
    initial = optimizer.ask()
    optimizer.tell(sphere(initial))
    same = np.all(optimizer.ask()[:, np.newaxis] == initial, axis=-1)
    assert not same.any()


# --- Gray code -----------------------------------------------------------------------


def test_gray_code_of_3_bits_by_hand():
    codes = ("000", "001", "011", "010", "110", "111", "101", "100")
    binary = binary_of_gray(chromosome(*codes), 3)
    assert decode(binary, 3, 0.0, 7.0).tolist() == list(range(8))


@pytest.mark.parametrize("bits", [1, 2, 5, 8])
def test_gray_code_is_a_bijection_whose_neighbours_differ_by_one_bit(bits):
    texts = [f"{level:0{bits}b}" for level in range(2**bits)]
    codes = np.stack([chromosome(text) for text in texts])
    levels = decode(binary_of_gray(codes, bits), bits, 0.0, 2.0**bits - 1).ravel()
    assert sorted(levels.tolist()) == list(range(2**bits))
    by_level = codes[np.argsort(levels)]
    # and the last differs by one bit from the first
    assert ((by_level != np.roll(by_level, 1, axis=0)).sum(axis=1) == 1).all()


def test_gray_genes_are_decoded_one_by_one():
    # 7, 2, 4 of 8 levels
    genes = chromosome("100", "011", "110")
    binary = binary_of_gray(np.stack([genes, genes]), 3)
    assert decode(binary, 3, 0.0, 7.0).tolist() == [[7, 2, 4]] * 2


def test_only_the_decoding_is_another_in_gray_code():
    binary, gray = make(bits=5), make(bits=5, coding="gray")
    assert binary.ask().tolist() != gray.ask().tolist()
    ours, theirs = make(bits=5).state(), make(bits=5, coding="gray").state()
    for key, array in ours.items():
        np.testing.assert_array_equal(array, theirs[key])
    decoded = decode(binary_of_gray(theirs["chromosomes"], 5), 5, -5.0, 5.0)
    np.testing.assert_array_equal(gray.population, decoded)


# --- Two points ----------------------------------------------------------------------


def test_two_points_exchange_exactly_the_middle():
    length, n_pairs = 9, 200
    parents = np.tile([[False] * length, [True] * length], (n_pairs, 1))
    children = two_point_crossover(parents, 0.5, np.random.default_rng(8))
    same = np.random.default_rng(8)
    one = same.integers(1, length, size=n_pairs)
    other = same.integers(1, length - 1, size=n_pairs)
    crossed = same.random(n_pairs) < 0.5
    assert set(crossed.tolist()) == {True, False}
    for pair in range(n_pairs):
        left = [point for point in range(1, length) if point != one[pair]]
        begin, end = sorted([int(one[pair]), left[other[pair] - 1]])
        begin, end = (begin, end) if crossed[pair] else (0, 0)
        first = chromosome("0" * begin, "1" * (end - begin), "0" * (length - end))
        assert children[2 * pair].tolist() == first.tolist()
        assert children[2 * pair + 1].tolist() == (~first).tolist()


def test_every_two_points_are_equally_likely():
    length, n_pairs = 5, 12_000
    parents = np.tile([[False] * length, [True] * length], (n_pairs, 1))
    children = two_point_crossover(parents, 1.0, np.random.default_rng(0))
    middles, counts = np.unique(children[0::2], axis=0, return_counts=True)
    # two of four points; both ends are never exchanged
    assert len(middles) == 6
    assert not middles[:, [0, -1]].any()
    assert scipy.stats.chisquare(counts).pvalue > 0.001


def test_smallest_chromosomes_of_two_points():
    one_gene = SearchSpace(genes=1, lower=-5, upper=5, init_lower=-5, init_upper=5)
    with pytest.raises(ValueError, match="at least 3 bits to cross, got 2"):
        make(space=one_gene, bits=2, crossover_points=2)
    optimizer = make(space=one_gene, bits=3, crossover_points=2)
    for _ in range(5):
        optimizer.tell(sphere(optimizer.ask()))
