"""Every registered task is a well-behaved dm_env environment."""

import dm_env
import numpy as np
import pytest
from dm_env import specs

import epuck_mj
from epuck_mj import SUITE, UserError
from epuck_mj.environments.dm_control import FollowWalls, environment
from epuck_mj.scene.model import load_scene
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.fitness import FORMULAS

TASKS = list(SUITE)
SHORT = TaskParameters(steps=20)


@pytest.fixture(params=TASKS)
def name(request) -> str:
    return request.param


def make(name: str, seed: int = 1, parameters=SHORT):
    return epuck_mj.load(name, {"random": seed, "parameters": parameters})


def play(env, n_steps: int, seed: int = 0) -> list[dm_env.TimeStep]:
    rng = np.random.default_rng(seed)
    spec = env.action_spec()
    actions = rng.uniform(spec.minimum, spec.maximum, (n_steps, 2))
    return [env.reset(), *(env.step(action) for action in actions)]


def test_specs_are_obeyed(name):
    env = make(name)
    action = env.action_spec()
    assert isinstance(action, specs.BoundedArray)
    np.testing.assert_array_equal(action.minimum, [0, -1])
    np.testing.assert_array_equal(action.maximum, [1, 1])
    for step in play(env, 60):
        for key, spec in env.observation_spec().items():
            spec.validate(step.observation[key])
        if step.first():
            assert step.reward is None
        else:
            assert 0 <= step.reward <= 1
            env.reward_spec().validate(step.reward)
            env.discount_spec().validate(step.discount)


def test_seed_decides(name):
    first, second, other = (play(make(name, seed), 45) for seed in (3, 3, 4))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(
            a.observation["proximity"], b.observation["proximity"]
        )
        assert a.reward == b.reward
    rewards = [[step.reward for step in steps] for steps in (first, other)]
    assert rewards[0] != rewards[1]


def test_episodes_of_one_seed_differ(name):
    env = make(name)
    scene = load_scene("epuck", "arena")
    poses = []
    for _ in range(5):
        env.reset()
        poses.append(tuple(scene.poses(env.physics.data.qpos)))
    assert len(set(poses)) == 5


def test_observations_do_not_share_memory(name):
    env = make(name)
    steps = play(env, 5)
    arrays = [step.observation["proximity"] for step in steps]
    for i, a in enumerate(arrays):
        for b in arrays[i + 1 :]:
            assert not np.shares_memory(a, b)


def test_episode_ends_after_its_steps(name):
    env = make(name)
    env.reset()
    steps = [env.step(np.zeros(2)) for _ in range(SHORT.steps)]
    assert [step.last() for step in steps] == [False] * (SHORT.steps - 1) + [True]
    # time ran out: the agent may hope for more
    assert steps[-1].discount == 1
    assert env.step(np.zeros(2)).first()


def test_default_episode_is_300_steps_of_a_tenth_of_a_second(name):
    env = epuck_mj.load(name, {"random": 1})
    assert env.control_timestep() == pytest.approx(0.1)
    env.reset()
    steps = 0
    while not env.step(np.zeros(2)).last():
        steps += 1
    assert steps + 1 == 300


def test_a_crash_terminates(name):
    env = make(name, parameters=TaskParameters(steps=300))
    time_step = env.reset()
    while not time_step.last():
        time_step = env.step(np.array([1.0, 0.0]))
    assert time_step.discount == 0
    assert time_step.reward == 0
    assert env.task.crashed(env.physics)


def test_reward_is_the_step_fitness(name):
    for fitness in ("product", "literal"):
        parameters = TaskParameters(steps=20, fitness=fitness)
        env = make(name, parameters=parameters)
        env.reset()
        for action in np.random.default_rng(0).uniform([0, -1], [1, 1], (19, 2)):
            time_step = env.step(action)
            if time_step.last():
                break
            expected = FORMULAS[fitness](action, time_step.observation["proximity"])
            assert time_step.reward == expected


def test_given_starts_come_first():
    scene = load_scene("epuck", "arena")
    starts = np.array([[0.1, 0.2, 0.3], [-0.1, 0.0, 3.0]])
    env = environment(scene, FollowWalls(scene, SHORT, starts=starts))
    for start in starts:
        env.reset()
        pose = scene.poses(env.physics.data.qpos)
        np.testing.assert_allclose(pose, start, atol=1e-12)
        assert not np.any(env.physics.data.qvel)
    with pytest.raises(RuntimeError, match="no start left"):
        env.reset()


def test_unknown_tasks_are_refused():
    with pytest.raises(UserError, match="'follow_wall'; available: follow_walls"):
        epuck_mj.load("follow_wall")


@pytest.mark.parametrize(
    "action",
    [
        [np.nan, 0.0],
        [0.0, -np.inf],
        [1e308, 1e308],
        [1.0],
        [[1.0, 0.0]],
        [1.0, [0.0]],
        ["1", "0"],
        [None, 0.0],
        [True, False],
        [1j, 0.0],
        [10**400, 0],
        "forward",
        None,
    ],
    ids=str,
)
def test_actions_that_are_no_numbers_are_refused(name, action):
    env = make(name)
    env.reset()
    with pytest.raises(UserError, match=r"^expected an action of two finite "):
        env.step(action)
    # as if nothing had been
    assert env.step(np.array([0.5, 0.0])).reward >= 0


def test_actions_may_be_of_any_numbers(name):
    rewards = []
    for action in ([1, 0], (1.0, 0.0), np.array([1, 0], np.float32)):
        env = make(name)
        env.reset()
        rewards.append(env.step(action).reward)
    assert len(set(rewards)) == 1


@pytest.mark.parametrize("random", ["abc", -1, 2**32, 1.5, True, [1, 2], "rng"])
def test_what_random_may_be_is_one_line(name, random):
    if random == "rng":
        random = np.random.default_rng(1)
    with pytest.raises(UserError) as error:
        epuck_mj.load(name, {"random": random})
    assert str(error.value).startswith(
        "random: expected a whole number from 0 to 4,294,967,295 (or a "
        "numpy.random.RandomState, or None), got "
    )


@pytest.mark.parametrize("random", [0, np.int64(3), np.random.RandomState(3), None])
def test_random_is_a_seed_a_generator_or_nothing(name, random):
    epuck_mj.load(name, {"random": random}).reset()


def test_a_robot_that_mujoco_does_not_move_is_refused():
    with pytest.raises(
        UserError, match="moves robots in MuJoCo: expected robot 'epuck'"
    ):
        epuck_mj.load("follow_walls", {"robot": "epuck_kinematic"})
