"""Genomes to fitness: the batch against one trial after another."""

import numpy as np
import pytest

from epuck_mj.policies.network import Network
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record
from evolution.judging import evaluation
from evolution.judging.evaluation import BatchEngine, DmControlEngine, evaluate

TASK = TaskParameters(steps=30)
NETWORK = Network()


@pytest.fixture(scope="module")
def starts() -> np.ndarray:
    scene = load_scene("epuck", "arena")
    return FreeSpace(scene, 0.01).sample(np.random.default_rng(0), 3)


@pytest.fixture(scope="module")
def genomes() -> np.ndarray:
    return np.random.default_rng(1).uniform(-5, 5, (6, NETWORK.n_genes))


def test_fitness_is_the_mean_over_all_starts(scene, starts, genomes):
    result = evaluate(BatchEngine(scene, TASK, 1), NETWORK, genomes, starts)
    for i, genome in enumerate(genomes):
        for j, start in enumerate(starts):
            trial = record(scene, NETWORK.decode(genome[None]), start, TASK)
            assert result.trial_fitness[i, j] == trial.trial_fitness
            assert result.steps[i, j] == trial.steps
            assert result.crashed[i, j] == trial.crashed
    np.testing.assert_allclose(result.fitness, result.trial_fitness.mean(axis=1))
    assert result.fitness.shape == (6,)


def test_engines_agree_to_the_last_bit(wheels, starts, genomes):
    batch = evaluate(BatchEngine(wheels, TASK), NETWORK, genomes, starts)
    single = evaluate(DmControlEngine(wheels, TASK), NETWORK, genomes, starts)
    np.testing.assert_array_equal(batch.trial_fitness, single.trial_fitness)
    np.testing.assert_array_equal(batch.steps, single.steps)
    np.testing.assert_array_equal(batch.crashed, single.crashed)


def test_chunks_change_nothing(scene, starts, genomes, monkeypatch):
    whole = evaluate(BatchEngine(scene, TASK), NETWORK, genomes, starts)
    monkeypatch.setattr(evaluation, "CAPACITY", 5)
    parts = evaluate(BatchEngine(scene, TASK), NETWORK, genomes, starts)
    np.testing.assert_array_equal(whole.trial_fitness, parts.trial_fitness)
    np.testing.assert_array_equal(whole.crashed, parts.crashed)


def test_a_crash_in_the_very_last_step_is_one_for_both_engines(wheels):
    """dm_control's time limit hides it in the discount."""
    ahead = np.zeros((1, 40))
    ahead[:, 32:36] = 5
    start = np.array([[0.38, 0.0, 0.0]])
    trial = record(wheels, NETWORK.decode(ahead), start[0], TASK)
    task = TaskParameters(steps=trial.steps)
    for engine in (BatchEngine(wheels, task), DmControlEngine(wheels, task)):
        result = evaluate(engine, NETWORK, ahead, start)
        assert result.steps[0, 0] == trial.steps
        assert result.crashed[0, 0]
