"""Trials one after the other, many at once: to the bit those of evaluation."""

import dataclasses
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils import seeding

from epuck_mj.constants import TRACK
from epuck_mj.environments.dm_control import FollowWalls, environment
from epuck_mj.environments.gymnasium import ID
from epuck_mj.policies.network import Network
from epuck_mj.rungs.disturbed import DisturbedRobots, disturbed
from epuck_mj.rungs.late import with_late_commands
from epuck_mj.rungs.table import RUNGS, robots_in
from epuck_mj.rungs.watched_robot import WatchedRobot
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import START_CLEARANCE, TaskParameters, run_trials
from epuck_mj.step.disturbances import NOISE, RANGES, draw_disturbances

N = 6
STEPS = 25
TURNS = 70
TASK = TaskParameters(steps=STEPS)
OTHER = Calibration((1.2, 0.8, 1, 1, 1, 1, 1, 1.1), (0.0201, 0.0206), 0.9 * TRACK)

CONDITIONS: dict[str, dict[str, Any]] = {
    "ideal": {},
    "late": {"latency": 2},
    "noise": {"noise": "calibrated"},
    "others": {"noise": "strong", "randomise": True},
    "one": {"noise": "calibrated", "calibration": OTHER},
}


@pytest.fixture(params=RUNGS)
def robot(request) -> str:
    return request.param


def controllers(n=N, seed=1):
    """Of different minds, and fast: some crash."""
    genomes = np.random.default_rng(seed).uniform(-5, 5, (n, Network().n_genes))
    genomes[:, 32:36], genomes[:, 36:] = 2.0, genomes[:, 36:] / 15
    return Network().decode(genomes)


def make(robot: str, n: int = N, **options: Any) -> Any:
    return gymnasium.make_vec(ID, num_envs=n, robot=robot, steps=STEPS, **options)


@dataclasses.dataclass
class Life:
    """A trial as the environment shows it."""

    robot: int
    observations: list
    fitness: float = 0.0
    steps: int = 0
    crashed: bool = False


def lives(env, policy, seed):
    """Trials that ended, by the turn of their start, in the order of the robots."""
    seen, _ = env.reset(seed=seed)
    n = env.num_envs
    going = [Life(i, [seen[i]]) for i in range(n)]
    begun, found = np.zeros(n, int), {}
    for turn in range(1, TURNS):
        action = np.asarray(policy(seen))
        seen, reward, crashed, truncated, infos = env.step(action)
        for i, life in enumerate(going):
            life.fitness += reward[i]
            life.steps += 1
            if not (crashed[i] or truncated[i]):
                life.observations.append(seen[i])
                continue
            life.crashed = bool(crashed[i])
            life.observations.append(infos["final_obs"][i])
            found.setdefault(int(begun[i]), []).append(life)
            going[i], begun[i] = Life(i, [seen[i]]), turn
    # who began when: the next draw is for all whose trials end in one turn
    turns = {turn: [] for turn in sorted({*begun.tolist(), *found})}
    for turn, some in found.items():
        turns[turn] += [(life.robot, life) for life in some]
    for i, turn in enumerate(begun.tolist()):
        turns[turn].append((i, None))
    return {
        turn: sorted(some, key=lambda each: each[0]) for turn, some in turns.items()
    }


class Watcher:
    """What robots observe in their trials."""

    def __init__(self, n):
        self.observations = [[] for _ in range(n)]

    def started(self, reading, observation):
        for mine, seen in zip(self.observations, observation, strict=True):
            mine.append(seen.copy())

    def stepped(self, k, active, step):
        for i, seen in zip(active, step.observation, strict=True):
            self.observations[i].append(seen.copy())


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_trial_is_that_of_evaluation(robot, name):
    options = CONDITIONS[name]
    policy = controllers()
    scene = load_scene(robot, "arena", TASK.control_step)
    space = FreeSpace(scene, START_CLEARANCE)
    late = options.get("latency", 0)
    given = {key: value for key, value in options.items() if key != "latency"}
    conditions = Conditions(**given)
    found = lives(make(robot, **options), policy, seed=3)
    # the streams of starts and of noise, as `begin` makes them
    seeds = seeding.np_random(3)[0].integers(2**63, size=2)
    of_starts, of_noise = map(np.random.default_rng, seeds)
    whole, crashes = 0, 0
    for some in found.values():
        starts = space.sample(of_starts, len(some))
        met = conditions.draw(of_noise, len(some), STEPS)
        numbers = np.array([i for i, _ in some])
        robots = robots_in(scene, len(some), 1)
        driven = disturbed(robots, met, TASK.control_step)
        if met is None:
            driven = with_late_commands(robots, late)
        watcher = Watcher(len(some))
        trials = run_trials(driven, policy[numbers], starts, TASK, watcher=watcher)
        for j, (_, life) in enumerate(some):
            if life is None:
                continue
            expected = trials.fitness[j], trials.steps[j], trials.crashed[j]
            assert (life.fitness, life.steps, life.crashed) == expected
            np.testing.assert_array_equal(life.observations, watcher.observations[j])
            whole += 1
            crashes += life.crashed
    # several lives each, ended in both ways
    assert whole >= 2 * N
    assert 0 < crashes < whole


def test_a_lone_agent_lives_as_one_of_many(robot):
    options: dict[str, Any] = {"noise": "calibrated", "randomise": True}
    one: Any = gymnasium.make(ID, robot=robot, steps=STEPS, **options)
    many = make(robot, n=1, **options)
    policy = controllers(1)
    (seen, _), (all_seen, _) = one.reset(seed=5), many.reset(seed=5)
    np.testing.assert_array_equal(seen, all_seen[0])
    over = False
    while not over:
        action = np.asarray(policy(seen[None]))
        seen, reward, crashed, truncated, _ = one.step(action[0])
        all_seen, rewards, crashes, ends, infos = many.step(action)
        over = crashed or truncated
        last = infos["final_obs"][0] if over else all_seen[0]
        np.testing.assert_array_equal(seen, last)
        assert (reward, crashed, truncated) == (rewards[0], crashes[0], ends[0])


def test_the_dm_control_task_gives_the_same_bits():
    start = np.array([0.3, -0.2, 1.0])
    scene = load_scene("epuck", "arena", TASK.control_step)
    task = FollowWalls(scene, TASK, starts=[start])
    env = gymnasium.make(ID, robot="epuck", steps=STEPS)
    seen, _ = env.reset(options={"start": start})
    other = environment(scene, task)
    time_step = other.reset()
    rng, crashed = np.random.default_rng(0), False
    while True:
        np.testing.assert_array_equal(seen, time_step.observation["proximity"])
        if time_step.last():
            break
        action = rng.uniform([0, -0.3], [1, 0.3])
        time_step = other.step(action)
        seen, reward, crashed, truncated, _ = env.step(action)
        assert reward == time_step.reward
        assert (crashed or truncated) == time_step.last()
    assert crashed == (time_step.discount == 0)


@pytest.mark.parametrize("options", [{}, {"noise": "strong", "randomise": True}])
def test_threads_change_nothing(robot, options):
    def played(seed, threads):
        env = make(robot, n=64, threads=threads, **options)
        env.action_space.seed(0)
        found = [env.reset(seed=seed)[0]]
        for _ in range(STEPS + 5):
            seen, reward, *_ = env.step(env.action_space.sample())
            found += [seen, reward]
        return found

    first = played(1, 1)
    for threads in (1, 2, 3):
        for a, b in zip(first, played(1, threads), strict=True):
            np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first[0], played(2, 1)[0])


def test_noise_changes_no_start():
    quiet, noisy = (make("epuck_kinematic", noise=each) for each in ("none", "strong"))
    for env in (quiet, noisy):
        env.reset(seed=4)
    poses = [env.unwrapped._trials.poses() for env in (quiet, noisy)]
    np.testing.assert_array_equal(*poses)
    for _ in range(STEPS):
        for env in (quiet, noisy):
            env.step(np.zeros((N, 2)))
    poses = [env.unwrapped._trials.poses() for env in (quiet, noisy)]
    np.testing.assert_array_equal(*poses)


def test_a_body_of_its_own_stays_with_the_robot_that_has_it():
    """Mass and friction of others are changed while a robot drives on wheels."""
    scene = load_scene("epuck", "arena", TASK.control_step)
    noise = NOISE["calibrated"]
    assert noise is not None
    starts = np.array([[0.0, 0.0, 0.3], [0.2, 0.1, 1.5]])
    command = np.array([[6.0, 3.0], [3.0, 6.0]])

    def met(seed):
        return draw_disturbances(np.random.default_rng(seed), 2, STEPS, noise, RANGES)

    alone, among = (
        DisturbedRobots(robots_in(scene, 2, 1), met(1), TASK.control_step)
        for _ in range(2)
    )
    for robots in (alone, among):
        robots.reset(starts)
    for k in range(STEPS):
        if k in (3, 8):
            among.renew(np.array([1]), met(k)[np.array([1])])
            among.restart(np.array([1]), starts[1:])
        a, b = (robots.step(command) for robots in (alone, among))
        np.testing.assert_array_equal(a.distance[0], b.distance[0])
        np.testing.assert_array_equal(alone.poses()[0], among.poses()[0])
    assert (alone.poses()[1] != among.poses()[1]).all()


def test_a_watched_robot_begins_anew_as_one_of_a_batch():
    scene = load_scene("epuck", "arena", TASK.control_step)
    robots = WatchedRobot(scene), robots_in(scene, 1, 1)
    starts, command = np.array([[0.3, 0.1, 0.2]]), np.array([[5.0, 2.0]])
    for each in robots:
        each.reset(np.zeros((1, 3)))
        each.step(command)
    readings = [each.restart(np.array([0]), starts) for each in robots]
    readings += [each.step(command) for each in robots]
    for one, other in (readings[:2], readings[2:]):
        np.testing.assert_array_equal(one.distance, other.distance)
    np.testing.assert_array_equal(robots[0].poses(), robots[1].poses())


def test_disturbances_that_are_shared_cannot_be_renewed():
    noise = NOISE["calibrated"]
    assert noise is not None
    met = draw_disturbances(np.random.default_rng(0), 2, STEPS, noise, RANGES)
    with pytest.raises(ValueError, match="share its disturbances with no other"):
        met.tiled(2).renew(np.array([0]), met[np.array([0])])
