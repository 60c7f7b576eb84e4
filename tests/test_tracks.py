"""Tracks: many trials at once are the trials that others run and record."""

import dataclasses

import numpy as np
import pytest

from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.mujoco_batch import SimulatedRobots
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters, run_trials
from epuck_mj.trials.tracks import record_tracks
from epuck_mj.trials.trajectory import record

TASK = TaskParameters(steps=80)
N = 12


@pytest.fixture(scope="module")
def starts(scene):
    return FreeSpace(scene, 0.01).sample(np.random.default_rng(3), N)


@pytest.fixture(scope="module")
def controllers():
    """Random ones that go straight on more often than others: some will crash."""
    genomes = np.random.default_rng(4).uniform(-5, 5, (N, Network().n_genes))
    genomes[: N // 2, -8:-4] = 5.0
    genomes[: N // 2, -4:] *= 0.1
    return Network().decode(genomes)


@pytest.mark.parametrize("capacity", [N, N - 1, 5])
def test_outcomes_are_those_of_run_trials_to_the_last_bit(
    scene, starts, controllers, capacity
):
    trials = run_trials(SimulatedRobots(scene, N, 1), controllers, starts, TASK)
    robots = SimulatedRobots(scene, capacity, 2)
    tracks = record_tracks(robots, controllers, starts, TASK)
    assert 0 < trials.crashed.sum() < N
    np.testing.assert_array_equal(tracks.trial_fitness, trials.fitness)
    np.testing.assert_array_equal(tracks.steps, trials.steps)
    np.testing.assert_array_equal(tracks.crashed, trials.crashed)


def test_each_is_the_trajectory_of_its_trial(scene, starts, controllers):
    robots = SimulatedRobots(scene, N, 2)
    tracks = record_tracks(robots, controllers, starts, TASK)
    for i in range(N):
        trajectory = record(scene, controllers[i], starts[i], TASK)
        steps = trajectory.steps
        assert tracks.lived[i].sum() == steps
        np.testing.assert_array_equal(tracks.pose[i, : steps + 1], trajectory.pose)
        np.testing.assert_array_equal(tracks.command[i, :steps], trajectory.command)
        np.testing.assert_array_equal(tracks.fitness[i, :steps], trajectory.fitness)
        # nothing is known of what did not happen
        assert np.isnan(tracks.pose[i, steps + 1 :]).all()
        assert np.isnan(tracks.command[i, steps:]).all()
        assert np.isnan(tracks.fitness[i, steps:]).all()


def test_a_policy_without_members_serves_any_number(scene, starts):
    robots = SimulatedRobots(scene, 5, 1)
    tracks = record_tracks(robots, WallFollower(), starts, TASK)
    trials = run_trials(SimulatedRobots(scene, N, 1), WallFollower(), starts, TASK)
    np.testing.assert_array_equal(tracks.trial_fitness, trials.fitness)


def test_no_starts_make_no_tracks(scene):
    robots = SimulatedRobots(scene, 1, 1)
    tracks = record_tracks(robots, WallFollower(), np.zeros((0, 3)), TASK)
    assert tracks.trial_fitness.shape == (0,)


def test_arrays_that_do_not_belong_together_are_refused(scene, starts):
    robots = SimulatedRobots(scene, N, 1)
    tracks = record_tracks(robots, WallFollower(), starts, TaskParameters(steps=3))
    with pytest.raises(ValueError, match="expected pose of shape"):
        dataclasses.replace(tracks, pose=tracks.pose[:, 1:])
