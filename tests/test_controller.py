"""The network against a slow loop."""

import math

import numpy as np
import pytest

from epuck_mj.policies.network import Controller, Network


def sigmoid(x: float) -> float:
    return 1 / (1 + math.exp(-x))


def slow(network: Network, genome: np.ndarray, observation: np.ndarray) -> list[float]:
    """The paper's network, one weight after the other."""
    weights = iter(genome)
    bias = network.biases
    hidden = []
    for _ in range(network.hidden):
        total = sum(next(weights) * x for x in observation)
        hidden.append(sigmoid(total + (next(weights) if bias else 0)))
    output = []
    for _ in range(2):
        total = sum(next(weights) * x for x in hidden)
        output.append(sigmoid(total + (next(weights) if bias else 0)))
    assert next(weights, None) is None
    return [output[0], 2 * output[1] - 1]


NETWORKS = [Network(), Network(biases=True), Network(hidden=7), Network(1, True)]


def test_the_paper_s_network_has_40_weights():
    assert Network().n_genes == 8 * 4 + 4 * 2 == 40
    assert Network(biases=True).n_genes == 46


@pytest.mark.parametrize("network", NETWORKS)
def test_against_a_slow_loop(network):
    rng = np.random.default_rng(0)
    genomes = rng.uniform(-5, 5, (20, network.n_genes))
    observations = rng.uniform(0, 1, (20, 8))
    actions = network.decode(genomes)(observations)
    for genome, observation, action in zip(genomes, observations, actions, strict=True):
        expected = slow(network, genome, observation)
        np.testing.assert_allclose(action, expected, rtol=1e-12)


@pytest.mark.parametrize("network", NETWORKS)
def test_alone_and_in_a_crowd_to_the_last_bit(network):
    rng = np.random.default_rng(1)
    genomes = rng.uniform(-5, 5, (257, network.n_genes))
    observations = rng.uniform(0, 1, (257, 8))
    crowd = network.decode(genomes)
    actions = crowd(observations)
    for size in (1, 2, 3, 7, 64):
        for first in range(0, 257 - size, 37):
            part = slice(first, first + size)
            some = network.decode(genomes[part])(observations[part])
            np.testing.assert_array_equal(some, actions[part])
            np.testing.assert_array_equal(crowd[part](observations[part]), some)
    for i in range(257):
        alone = network.decode(genomes[i])(observations[i])
        np.testing.assert_array_equal(alone, actions[i])


def test_picking_members_by_mask():
    network = Network()
    rng = np.random.default_rng(2)
    controllers = network.decode(rng.uniform(-5, 5, (10, 40)))
    observations = rng.uniform(0, 1, (10, 8))
    mask = rng.random(10) < 0.5
    some: Controller = controllers[mask]
    np.testing.assert_array_equal(
        some(observations[mask]), controllers(observations)[mask]
    )


def test_huge_weights_saturate_without_warnings():
    action = Network().decode(np.full(40, 1e300))(np.ones(8))
    np.testing.assert_array_equal(action, [1, 1])
    action = Network().decode(np.full(40, -1e3))(np.ones(8))
    np.testing.assert_allclose(action, [0.5, 0], atol=1e-12)


def test_observations_and_genomes_are_left_alone():
    genome, observation = np.ones(40), np.full(8, 0.5)
    action = Network().decode(genome)(observation)
    action[:] = 9
    np.testing.assert_array_equal(genome, 1)
    np.testing.assert_array_equal(observation, 0.5)


def test_wrong_length_is_refused():
    with pytest.raises(ValueError, match="expected genomes of 40 genes"):
        Network().decode(np.zeros(39))
