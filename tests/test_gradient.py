"""Gradients of the network against finite differences."""

import numpy as np
import pytest

from epuck_mj.policies.gradient import gradient, in_all_steps, squashing_slope
from epuck_mj.policies.network import Network, squashed
from evolution.search.learning_rules import (
    Rule,
    imitation_gradient,
    moved,
    policy_gradient,
    reward_to_go,
)
from evolution.search.lessons import Life
from evolution.search.search_space import SearchSpace

NETWORKS = [Network(), Network(1, True), Network(3, True), Network(7)]


def differences(function, genomes: np.ndarray, by: float = 1e-6) -> np.ndarray:
    """Central differences `(n, genes)` of `function(genomes) -> (n,)`."""
    slopes = []
    for gene in range(genomes.shape[1]):
        step = by * (np.arange(genomes.shape[1]) == gene)
        slopes.append((function(genomes + step) - function(genomes - step)) / (2 * by))
    return np.stack(slopes, axis=1)


@pytest.fixture(params=NETWORKS, ids=str)
def network(request) -> Network:
    return request.param


@pytest.fixture
def drawn(network) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Genomes of 3 learners, what each observes in 11 steps, and two numbers a step."""
    rng = np.random.default_rng(0)
    return (
        rng.normal(0, 2, (3, network.n_genes)),
        rng.random((3, 11, 8)),
        rng.normal(size=(3, 11, 2)),
    )


def test_gradient_of_the_sums(network, drawn):
    genomes, observation, weights = drawn

    def total(genomes: np.ndarray) -> np.ndarray:
        sums = in_all_steps(network.decode(genomes)).sums(observation)
        return (weights * sums).sum(axis=(1, 2))

    found = gradient(network, network.decode(genomes), observation, weights)
    np.testing.assert_allclose(found, differences(total, genomes), atol=1e-7)


def test_gradient_of_imitation(network, drawn):
    genomes, observation, weights = drawn
    action = squashed(weights)
    # what does not matter has no effect
    action[0, 3:] = np.nan

    def agreement(genomes: np.ndarray) -> np.ndarray:
        own = in_all_steps(network.decode(genomes))(observation)
        return -0.5 * np.nansum((action - own) ** 2, axis=(1, 2))

    found = imitation_gradient(network, genomes, observation, action)
    np.testing.assert_allclose(found, differences(agreement, genomes), atol=1e-7)


def test_slope_of_squashing():
    sums = np.linspace(-4, 4, 9).repeat(2).reshape(-1, 2)
    slope = (squashed(sums + 1e-6) - squashed(sums - 1e-6)) / 2e-6
    np.testing.assert_allclose(squashing_slope(squashed(sums)), slope, atol=1e-9)


def test_reward_to_go_is_the_discounted_sum():
    reward = np.random.default_rng(0).random((2, 3, 5))
    expected = np.zeros_like(reward)
    for k in range(5):
        for later in range(k, 5):
            expected[..., k] += 0.9 ** (later - k) * reward[..., later]
    np.testing.assert_allclose(reward_to_go(reward, 0.9), expected)


def test_policy_gradient_is_that_of_what_was_tried(network, drawn):
    genomes, observation, _ = drawn
    rng, rule = np.random.default_rng(1), Rule(0.1, 0.5, 0.9)
    seen = observation[:, :10].reshape(3, 2, 5, 8)
    tried = 0.5 * rng.normal(size=(3, 2, 5, 2))
    lived = np.arange(5) < np.array([5, 3])[:, None]
    lived = np.broadcast_to(lived, (3, 2, 5))
    reward = np.where(lived, rng.random((3, 2, 5)), 0.0)
    chosen = in_all_steps(network.decode(genomes)).sums(observation[:, :10])
    chosen = chosen.reshape(3, 2, 5, 2) + tried
    to_go = reward_to_go(reward, 0.9)
    advantage = np.where(lived, to_go - to_go.mean(axis=1, keepdims=True), 0.0)

    def likelihood(genomes: np.ndarray) -> np.ndarray:
        sums = in_all_steps(network.decode(genomes)).sums(observation[:, :10])
        off = chosen - sums.reshape(3, 2, 5, 2)
        log = -0.5 * (off**2).sum(axis=-1) / 0.5**2
        return (advantage * log).sum(axis=(1, 2))

    found = policy_gradient(network, genomes, Life(seen, tried, reward, lived), rule)
    np.testing.assert_allclose(found, differences(likelihood, genomes), atol=1e-6)


def test_steps_have_their_length_and_stay_in_bounds():
    space = SearchSpace(4, -1, 1, -1, 1)
    genomes = np.array([[0.0, 0, 0, 0], [0, 0, 0, 0], [0.9, 0, 0, 0]])
    direction = np.array([[3.0, 4, 0, 0], [0, 0, 0, 0], [5, 0, 0, 0]])
    got = moved(genomes, direction, 0.5, space)
    np.testing.assert_allclose(got, [[0.3, 0.4, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0]])
