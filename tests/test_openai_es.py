"""Ranks and gradients by hand, Adam against a slow oracle, and bounds."""

import math

import numpy as np
import pytest

from evolution.search.openai_es import (
    OpenAiEs,
    OpenAiEsParameters,
    centred_ranks,
    estimated_gradient,
)
from evolution.search.search_space import SearchSpace

SPACE = SearchSpace(genes=3, lower=-5, upper=5, init_lower=-5, init_upper=5)


def make(seed=0, space=SPACE, **changes) -> OpenAiEs:
    parameters = OpenAiEsParameters(**changes)
    return OpenAiEs(parameters, space, np.random.default_rng(seed))


def sphere(genomes: np.ndarray) -> np.ndarray:
    return -np.sum(genomes**2, axis=-1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pairs": 0}, "^pairs: expected a whole number from 1 to 100,000, got 0$"),
        ({"sigma": 0.0}, "^sigma: expected a number above 0, at most .*, got 0.0$"),
        ({"sigma": 10.5}, "^sigma: expected at most 10, the width of .*, got 10.5$"),
        ({"learning_rate": 0.0}, "^learning_rate: expected a number above 0, .*0.0$"),
        ({"learning_rate": 11.0}, "^learning_rate: expected at most 10, the .*11.0$"),
        ({"weight_decay": -0.1}, "^weight_decay: expected a number from 0 to 1, .*1$"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


# --- Ranks and gradient --------------------------------------------------------------


@pytest.mark.parametrize(
    ("fitness", "ranks"),
    [
        ([10.0, 30.0, 20.0], [-0.5, 0.5, 0.0]),
        ([7.0, -np.inf, 7.0, 100.0, 8.0], [-0.125, -0.5, -0.125, 0.5, 0.25]),
        ([4.0, 4.0, 4.0, 4.0], [0, 0, 0, 0]),
        ([-np.inf, -np.inf], [0, 0]),
        ([np.inf, 1.0], [0.5, -0.5]),
    ],
)
def test_ranks_by_hand(fitness, ranks):
    assert centred_ranks(np.array(fitness)).tolist() == ranks


def test_the_gradient_by_hand():
    centre, step = np.array([1.0, 2.0]), np.array([[2.0, 0.0], [0.0, -2.0]])
    ranks = np.array([0.5, -0.25, -0.5, 0.25])
    gradient = estimated_gradient(centre + step, centre - step, ranks, 2.0)
    # ((0.5 + 0.5) / 2 (1, 0) + (-0.25 - 0.25) / 2 (0, -1)) / 2
    assert gradient.tolist() == [0.25, 0.125]


def test_the_gradient_is_that_of_a_linear_fitness():
    rng = np.random.default_rng(0)
    slope = np.array([3.0, -1.0, 0.0, 2.0])
    steps = rng.standard_normal((4000, 4))
    ranks = centred_ranks(np.concatenate([steps, -steps]) @ slope)
    gradient = estimated_gradient(0.3 * steps, -0.3 * steps, ranks, 0.3)
    cosine = gradient @ slope / np.sqrt((gradient @ gradient) * (slope @ slope))
    assert cosine > 0.999


# --- Generations ---------------------------------------------------------------------


def test_pairs_mirror_one_another_at_the_centre_which_is_asked_last():
    optimizer = make(pairs=6, sigma=0.1)
    optimizer.tell(sphere(optimizer.ask()))
    for _ in range(5):
        asked, centre = optimizer.ask(), optimizer.population
        plus, minus, centre = asked[:6], asked[6:12], asked[12]
        np.testing.assert_allclose((plus + minus) / 2, np.tile(centre, (6, 1)))
        optimizer.tell(sphere(asked))
        np.testing.assert_array_equal(optimizer.population, asked)
    assert optimizer.next_size() == 13


def test_the_best_of_the_first_generation_is_the_first_centre():
    optimizer = make(pairs=2)
    first = optimizer.ask()
    optimizer.tell([1, 9, np.nan, 9, 3])
    np.testing.assert_array_equal(optimizer.ask()[-1], first[1])


def test_the_centres_own_fitness_does_not_move_it():
    a, b = make(), make()
    for optimizer, own in ((a, -1e9), (b, 1e9)):
        optimizer.tell(sphere(optimizer.ask()))
        told = sphere(optimizer.ask())
        told[-1] = own
        optimizer.tell(told)
    np.testing.assert_array_equal(a.ask(), b.ask())


def slow_centres(optimizer, generations, fitness, parameters):
    """Centres `(generations, genes)` from the optimiser's own samples, with loops."""
    first = optimizer.ask()
    optimizer.tell(fitness(first))
    centre = first[np.argmax(fitness(first))].tolist()
    mean, square = [0.0] * len(centre), [0.0] * len(centre)
    for t in range(1, generations + 1):
        asked = optimizer.ask()
        yield asked[-1], centre
        pairs = parameters.pairs
        scores = fitness(asked)[:-1].tolist()
        ranks = [
            (sum(o < s for o in scores) + sum(o <= s for o in scores) - 1)
            / (2 * (len(scores) - 1))
            - 0.5
            for s in scores
        ]
        for j in range(len(centre)):
            gradient = 0.0
            for i in range(pairs):
                half = (asked[i, j] - asked[pairs + i, j]) / 2 / parameters.sigma
                gradient += (ranks[i] - ranks[pairs + i]) / 2 * half / pairs
            gradient -= parameters.weight_decay * centre[j]
            mean[j] = 0.9 * mean[j] + 0.1 * gradient
            square[j] = 0.999 * square[j] + 0.001 * gradient**2
            m, v = mean[j] / (1 - 0.9**t), square[j] / (1 - 0.999**t)
            centre[j] += parameters.learning_rate * m / (math.sqrt(v) + 1e-8)
            centre[j] = min(max(centre[j], -5.0), 5.0)
        optimizer.tell(fitness(asked))


@pytest.mark.parametrize("decay", [0.0, 0.05])
def test_fast_is_slow(decay):
    # Rounding makes plateaus, so that ties happen; the best is near a corner.
    def fitness(genomes):
        return np.round(sphere(genomes - [4.9, 4.9, -4.9]))

    optimizer = make(pairs=5, learning_rate=0.3, weight_decay=decay)
    for fast, slow in slow_centres(optimizer, 60, fitness, optimizer._parameters):
        np.testing.assert_allclose(fast, slow, rtol=1e-9, atol=1e-9)


def test_the_first_step_is_the_learning_rate():
    optimizer = make(learning_rate=0.25)
    optimizer.tell(sphere(optimizer.ask()))
    asked = optimizer.ask()
    optimizer.tell(asked.sum(axis=1))
    moved = optimizer.ask()[-1] - asked[-1]
    assert np.abs(moved).tolist() == pytest.approx([0.25] * 3, rel=1e-6)


def test_without_differences_it_stays_where_it_is():
    optimizer = make()
    optimizer.tell(sphere(optimizer.ask()))
    centre = optimizer.ask()[-1]
    optimizer.tell(np.full(optimizer.next_size(), 7.0))
    np.testing.assert_array_equal(optimizer.ask()[-1], centre)


def test_weights_decay_where_nothing_else_moves_them():
    optimizer = make(weight_decay=0.1)
    optimizer.tell(sphere(optimizer.ask()))
    centre = optimizer.ask()[-1]
    optimizer.tell(np.full(optimizer.next_size(), 7.0))
    after = optimizer.ask()[-1]
    assert (np.abs(after) < np.abs(centre)).all()


def test_a_clipped_pair_counts_as_what_was_asked():
    corner = SearchSpace(genes=2, lower=-1, upper=1, init_lower=1, init_upper=1)
    optimizer = make(space=corner, pairs=200, sigma=0.5)
    optimizer.tell(np.zeros(len(optimizer.ask())))
    asked = optimizer.ask()
    assert (asked[-1] == 1).all()
    assert asked.max() == 1
    # one genome of each pair is at the bound, gene by gene
    assert ((asked[:200] == 1) | (asked[200:400] == 1)).all()
    optimizer.tell(-asked.sum(axis=1))
    assert (optimizer.ask()[-1] < 1).all()
