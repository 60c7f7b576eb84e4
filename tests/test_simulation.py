"""Batched trials against dm_control, step by step and bit by bit."""

import resource

import numpy as np
import pytest

from epuck_mj.environments.dm_control import FollowWalls, environment
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.rungs.watched_robot import WatchedRobot
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters, run_trials
from epuck_mj.trials.recorder import record

TASK = TaskParameters(steps=80)
N = 12


@pytest.fixture(scope="module")
def scene(wheels) -> Scene:
    return wheels


@pytest.fixture(scope="module")
def starts(scene) -> np.ndarray:
    return FreeSpace(scene, 0.01).sample(np.random.default_rng(0), N)


@pytest.fixture(scope="module")
def controllers():
    genomes = np.random.default_rng(1).uniform(-5, 5, (N, 40))
    # some that are sure to hit a wall: full speed ahead
    genomes[::4, 32:36], genomes[::4, 36:] = 5, 0
    return Network().decode(genomes)


def test_trajectories_equal_dm_control_s_to_the_last_bit(scene, starts, controllers):
    """Poses, readings, observations, rewards and the end of every trial."""
    crashes = 0
    for fitness in ("product", "literal"):
        task = TaskParameters(steps=80, fitness=fitness)
        trials = run_trials(MujocoRobots(scene, N, 2), controllers, starts, task)
        env = environment(scene, FollowWalls(scene, task, starts=starts))
        for i in range(N):
            batch = record(scene, controllers[i : i + 1], starts[i], task)
            time_step, total = env.reset(), 0.0
            for step in range(batch.steps):
                observation = time_step.observation["proximity"]
                np.testing.assert_array_equal(observation, batch.observation[step])
                pose = scene.poses(env.physics.data.qpos)
                np.testing.assert_array_equal(pose, batch.pose[step])
                action = controllers[i](observation)
                np.testing.assert_array_equal(action, batch.action[step])
                time_step = env.step(action)
                assert time_step.reward == batch.fitness[step]
                total += time_step.reward
            assert time_step.last()
            last = time_step.observation["proximity"]
            np.testing.assert_array_equal(last, batch.observation[-1])
            assert trials.fitness[i] == total == batch.trial_fitness
            assert trials.steps[i] == batch.steps
            assert trials.crashed[i] == batch.crashed
            crashes += batch.crashed
    assert 0 < crashes < 2 * N


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_change_nothing(scene, starts, controllers, threads):
    one = run_trials(MujocoRobots(scene, N, 1), controllers, starts, TASK)
    many = run_trials(MujocoRobots(scene, N, threads), controllers, starts, TASK)
    np.testing.assert_array_equal(one.fitness, many.fitness)
    np.testing.assert_array_equal(one.steps, many.steps)


def test_company_changes_nothing(scene, starts, controllers):
    """Alone, in any subset, in any order, in robots used before."""
    robots = MujocoRobots(scene, N + 3, 1)
    everybody = run_trials(robots, controllers, starts, TASK)
    rng = np.random.default_rng(2)
    for size in (1, 2, 5, N):
        some = rng.permutation(N)[:size]
        part = run_trials(robots, controllers[some], starts[some], TASK)
        np.testing.assert_array_equal(part.fitness, everybody.fitness[some])
        np.testing.assert_array_equal(part.steps, everybody.steps[some])
        np.testing.assert_array_equal(part.crashed, everybody.crashed[some])


def test_crashed_robots_are_not_stepped_again(scene):
    """Their time stands still while the others' goes on."""
    robots = MujocoRobots(scene, 2, 1)
    robots.reset(np.array([[0.45, 0, 0], [0, 0, 0]]))
    for _ in range(5):
        reading = robots.step(np.full((len(robots.poses()), 2), 6.0))
        robots.keep(~reading.contact)
    time = robots._batch.bind("time")
    assert time[1] == pytest.approx(0.5)
    assert 0 < time[0] < 0.3


def test_a_crash_ends_the_sum(scene):
    """What was earned before counts; the crash step earns nothing."""
    ahead = np.zeros(40)
    ahead[32:36] = 5
    start = np.array([[0.38, 0.0, 0.0]])
    controller = Network().decode(ahead[None])
    trials = run_trials(MujocoRobots(scene, 1, 1), controller, start, TASK)
    assert trials.crashed[0]
    trajectory = record(scene, controller, start[0], TASK)
    assert trajectory.fitness[-1] == 0
    assert (trajectory.fitness[-3:-1] > 0).all()
    assert trials.fitness[0] == trajectory.trial_fitness


def test_too_many_starts_are_refused(scene):
    with pytest.raises(ValueError, match="at most 2 starts, got 3"):
        MujocoRobots(scene, 2).reset(np.zeros((3, 3)))


def test_the_hand_written_wall_follower_follows_walls(scene):
    """It lives and earns more than half of what there is to earn."""
    starts = FreeSpace(scene, 0.01).sample(np.random.default_rng(3), 40)
    robots = MujocoRobots(scene, 40)
    trials = run_trials(robots, WallFollower(), starts, TaskParameters())
    assert trials.fitness.mean() > 180
    assert trials.crashed.mean() < 0.05


@pytest.mark.slow
def test_memory_stays_flat_over_5000_trials(scene):
    starts = FreeSpace(scene, 0.01).sample(np.random.default_rng(4), 500)
    genomes = np.random.default_rng(5).uniform(-5, 5, (500, 40))
    robots = MujocoRobots(scene, 500)
    task, peak = TaskParameters(steps=1), []
    for _ in range(12):
        run_trials(robots, Network().decode(genomes), starts, task)
        peak.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    # after the first 1,000 trials have touched all memory, in KiB
    assert peak[-1] - peak[1] < 4096


def test_a_touch_in_any_physics_step_is_a_crash(scene):
    """Against a robot that is looked at after every physics step."""
    # along a wall, at a shallow angle: some robots touch it and are off it again
    n = 24
    clearance = np.linspace(2e-5, 2e-3, n)
    starts = np.stack(
        [
            np.zeros(n),
            -0.5 + 0.035 + clearance,
            np.tile([-0.3, 0.0, 0.3, -0.1], n // 4),
        ],
        axis=1,
    )
    rng = np.random.default_rng(3)
    commands = rng.uniform(-6, 6, (12, n, 2))
    batch = MujocoRobots(scene, n, 1)
    seen = np.array([batch.reset(starts).contact]).repeat(13, axis=0)
    for k, command in enumerate(commands):
        seen[k + 1] = batch.step(command).contact
    brief = 0
    for i in range(n):
        robot, touches = WatchedRobot(scene), list[bool]()
        # what the model says now, without its memory
        robot.moved = lambda robot=robot, touches=touches: touches.append(
            bool(scene.reading(robot.data.sensordata).contact)
        )
        robot.reset(starts[i : i + 1])
        assert touches.pop() == seen[0, i]
        for k, command in enumerate(commands):
            touches.clear()
            reading = robot.step(command[i : i + 1])
            assert len(touches) == scene.n_substeps
            # the step before's last is the first that is remembered
            assert any(touches) | (seen[k, i] and seen[k + 1, i]) == seen[k + 1, i]
            assert bool(reading.contact[0]) == seen[k + 1, i]
            brief += any(touches) and not touches[-1]
    assert brief > 0


@pytest.mark.parametrize("control_step", [0.05, 0.1, 0.2])
def test_rays_are_new_whenever_they_are_read(control_step):
    """Over many control steps: MuJoCo's time is a sum of rounded numbers."""
    scene = load_scene("epuck", "arena", control_step)
    starts = FreeSpace(scene, 0.1).sample(np.random.default_rng(5), 1)
    robot, watched = MujocoRobots(scene, 1, 1), WatchedRobot(scene)
    robot.reset(starts)
    watched.reset(starts)
    for k in range(1500):
        command = np.array([[3.0, 3.0 + 2 * np.sin(k / 7)]])
        reading, expected = robot.step(command), watched.step(command)
        np.testing.assert_array_equal(reading.distance, expected.distance)
