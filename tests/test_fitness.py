"""Step fitness by hand."""

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.fitness import (
    FORMULAS,
    literal,
    of_most,
    product,
    spaced,
    step_fitness,
)


def seen(nearest: float) -> np.ndarray:
    observation = np.ones(8)
    observation[3] = nearest
    return observation


@pytest.mark.parametrize(
    ("v", "w", "nearest", "by_prose", "as_printed"),
    [
        (1, 0, 0, 1, 1),
        (1, 0, 1, 0, 1),
        (1, 1, 0, 0, 0),
        (1, -1, 0, 0, 0),
        # the print rewards circles in the open
        (1, 1, 1, 0, 1),
        (0, 0, 0, 0, 0),
        (0.8, -0.5, 0.25, 0.8 * 0.5 * 0.75, 0.8 * (1 - 0.5 * 0.75)),
    ],
)
def test_by_hand(v, w, nearest, by_prose, as_printed):
    action = np.array([v, w], float)
    assert product(action, seen(nearest)) == pytest.approx(by_prose)
    assert literal(action, seen(nearest)) == pytest.approx(as_printed)


@pytest.mark.parametrize(
    ("millimetres", "expected"),
    [(0, 0), (4, 0.5), (8, 1), (12, 1), (15, 1), (27.5, 0.5), (40, 0)],
)
def test_a_distance_to_the_wall_pays_most(millimetres, expected):
    observation = seen(millimetres / 40)
    assert spaced(np.array([1.0, 0.0]), observation) == pytest.approx(expected)
    half = spaced(np.array([0.5, -0.5]), observation)
    assert half == pytest.approx(0.25 * expected)


@pytest.mark.parametrize("name", FORMULAS)
def test_a_share_of_one_for_any_batch(name):
    rng = np.random.default_rng(0)
    actions = rng.uniform([0, -1], [1, 1], (7, 5, 2))
    observations = rng.uniform(0, 1, (7, 5, 8))
    fitness = FORMULAS[name](actions, observations)
    assert fitness.shape == (7, 5)
    assert ((fitness >= 0) & (fitness <= 1)).all()
    for index in np.ndindex(7, 5):
        alone = FORMULAS[name](actions[index], observations[index])
        assert fitness[index] == alone


def test_unknown_names_are_refused():
    with pytest.raises(UserError, match="'prose'; available: literal, product, spaced"):
        step_fitness("prose")


def test_a_fitness_is_said_of_the_most_there_is():
    assert of_most(51.72, TaskParameters(steps=300).most) == "51.7 of 300"
    assert of_most(51.72, None) == "51.7"
