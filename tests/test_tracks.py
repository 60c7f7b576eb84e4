"""Tracks: many trials at once are the trials that others run and record."""

import dataclasses

import numpy as np
import pytest

from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters, run_trials
from epuck_mj.step.sensors import proximity
from epuck_mj.trials.recorder import record, record_tracks, record_trajectories

TASK = TaskParameters(steps=60)
N = 8


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
    trials = run_trials(robots_in(scene, N, 1), controllers, starts, TASK)
    robots = robots_in(scene, capacity, 2)
    tracks = record_tracks(robots, controllers, starts, TASK)
    assert 0 < trials.crashed.sum() < N
    np.testing.assert_array_equal(tracks.trial_fitness, trials.fitness)
    np.testing.assert_array_equal(tracks.steps, trials.steps)
    np.testing.assert_array_equal(tracks.crashed, trials.crashed)


def test_each_is_the_trajectory_of_its_trial(scene, starts, controllers):
    robots = robots_in(scene, N, 2)
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


def test_with_disturbances_they_are_still_the_trials_of_run_trials(
    scene, starts, controllers
):
    conditions = Conditions("strong", randomise=True)
    met = conditions.draw(np.random.default_rng(5), N, TASK.steps)
    assert met is not None
    robots = disturbed(robots_in(scene, N, 1), met, TASK.control_step)
    trials = run_trials(robots, controllers, starts, TASK)
    ideal = record_tracks(robots_in(scene, N, 1), controllers, starts, TASK)
    # fewer robots than trials: each part meets its own disturbances
    tracks = record_tracks(robots_in(scene, 5, 1), controllers, starts, TASK, met)
    np.testing.assert_array_equal(tracks.trial_fitness, trials.fitness)
    np.testing.assert_array_equal(tracks.crashed, trials.crashed)
    assert (tracks.trial_fitness != ideal.trial_fitness).any()
    for i in range(N):
        own = met[i : i + 1]
        trajectory = record(scene, controllers[i], starts[i], TASK, own)
        assert trajectory.trial_fitness == trials.fitness[i]
        assert trajectory.crashed == trials.crashed[i]
        # what was counted with noise, and where the walls really were
        assert (trajectory.proximity != np.rint(proximity(trajectory.distance))).any()


def test_many_trajectories_are_those_recorded_one_by_one(scene, starts):
    together = record_trajectories(scene, WallFollower(), starts, TASK)
    for start, trajectory in zip(starts, together, strict=True):
        alone = record(scene, WallFollower(), start, TASK)
        for field in dataclasses.fields(alone):
            np.testing.assert_array_equal(
                getattr(trajectory, field.name), getattr(alone, field.name)
            )


def test_a_policy_without_members_serves_any_number(scene, starts):
    robots = robots_in(scene, 5, 1)
    tracks = record_tracks(robots, WallFollower(), starts, TASK)
    trials = run_trials(robots_in(scene, N, 1), WallFollower(), starts, TASK)
    np.testing.assert_array_equal(tracks.trial_fitness, trials.fitness)


def test_no_starts_make_no_tracks(scene):
    robots = robots_in(scene, 1, 1)
    tracks = record_tracks(robots, WallFollower(), np.zeros((0, 3)), TASK)
    assert tracks.trial_fitness.shape == (0,)


def test_arrays_that_do_not_belong_together_are_refused(scene, starts):
    robots = robots_in(scene, N, 1)
    tracks = record_tracks(robots, WallFollower(), starts, TaskParameters(steps=3))
    with pytest.raises(ValueError, match="expected pose of shape"):
        dataclasses.replace(tracks, pose=tracks.pose[:, 1:])
