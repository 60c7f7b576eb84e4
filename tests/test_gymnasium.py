"""Gymnasium's environments: as the library wants them, and clear about bad input."""

import ctypes.util
import importlib
import re
import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from epuck_mj.environments.gymnasium import ID, FollowWallsEnv, FollowWallsVectorEnv
from epuck_mj.errors import UserError
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.model_files import MODELS
from epuck_mj.show import render
from epuck_mj.step.calibration import Calibration

ARENAS = sorted(path.stem for path in (MODELS / "arenas").glob("*.xml"))
ON_WHEELS = ["arena", "round", "pillars"]
AHEAD = np.array([1.0, 0.0])

needs_opengl = pytest.mark.skipif(
    not (ctypes.util.find_library("EGL") or ctypes.util.find_library("OSMesa")),
    reason="no library of EGL or OSMesa to draw with",
)


def make(**options: Any) -> Any:
    return gymnasium.make(ID, **options)


def make_vec(n: Any, **options: Any) -> Any:
    return gymnasium.make_vec(ID, num_envs=n, **options)


def test_the_long_name_registers_by_itself():
    env = gymnasium.make(f"epuck_mj.environments.gymnasium:{ID}")
    assert isinstance(env.unwrapped, FollowWallsEnv)
    assert isinstance(make_vec(2), FollowWallsVectorEnv)
    mode = {"vectorization_mode": "vector_entry_point"}
    assert isinstance(make_vec(2, **mode), FollowWallsVectorEnv)


@pytest.mark.parametrize(
    ("robot", "arena"),
    [("epuck_kinematic", arena) for arena in ("arena", *ARENAS)]
    + [("epuck", arena) for arena in ON_WHEELS],
)
def test_the_library_finds_nothing_wrong(robot, arena):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = make(robot=robot, arena=arena).unwrapped
        check_env(env, skip_render_check=True)


@pytest.mark.parametrize(
    "options",
    [
        {"noise": "calibrated"},
        {"noise": "strong", "randomise": True},
        {"noise": "calibrated", "randomise_all": True},
        {"noise": "calibrated", "calibration": Calibration(track=0.05)},
        {"latency": 3},
        {"fitness": "literal", "sensor_range": 0.06, "v_max": 0.1, "w_max": 2.0},
        {"control_step": 0.05, "steps": 7, "start_clearance": 0.05},
    ],
    ids=str,
)
def test_nor_with_other_options(options):
    check_env(make(**options).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("robot", RUNGS)
@pytest.mark.parametrize("noise", ["none", "calibrated"])
def test_the_spaces_of_many_are_obeyed(robot, noise):
    env = make_vec(5, robot=robot, steps=12, noise=noise)
    env.action_space.seed(0)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    seen, infos = env.reset(seed=1)
    assert infos == {}
    for _ in range(30):
        assert seen in env.observation_space
        assert seen.dtype == np.float64
        seen, reward, crashed, over, infos = env.step(env.action_space.sample())
        assert (reward.shape, reward.dtype) == ((5,), np.float64)
        assert ((reward >= 0) & (reward <= 1)).all()
        for flags in (crashed, over):
            assert (flags.shape, flags.dtype) == ((5,), bool)
        assert not (crashed & over).any()
        assert bool(infos) == (crashed | over).any()


def test_one_step_has_the_types_of_python():
    env = make(robot="epuck_kinematic").unwrapped
    seen, _ = env.reset(seed=1)
    assert (seen.shape, seen.dtype) == ((8,), np.float64)
    seen, reward, crashed, over, infos = env.step(AHEAD)
    assert type(reward) is float
    assert type(crashed) is bool
    assert type(over) is bool
    assert infos == {}


@pytest.mark.parametrize("n", [None, 3])
def test_seeds(n):
    def played(seed):
        env = make() if n is None else make_vec(n)
        env.action_space.seed(0)
        found: list[Any] = [env.reset(seed=seed)[0]]
        places = []
        for _ in range(3):
            places.append(env.unwrapped._trials.poses())
            action = env.action_space.sample()
            found += [env.step(action)[:4] for _ in range(3)]
            # no seed goes on with the one before
            found.append(env.reset()[0])
        assert len(np.unique(np.concatenate(places), axis=0)) == 3 * (n or 1)
        return [*found, *places]

    first, second, other = (played(seed) for seed in (3, 3, 4))
    assert data_equivalence(first, second, exact=True)
    assert not data_equivalence(first, other)


@pytest.mark.parametrize("robot", RUNGS)
def test_a_crash_terminates(robot):
    env = make(robot=robot).unwrapped
    env.reset(options={"start": [0.3, 0.0, 0.0]})
    rewards = []
    crashed = over = False
    while not (crashed or over):
        _, reward, crashed, over, _ = env.step(AHEAD)
        rewards.append(reward)
    assert (crashed, over) == (True, False)
    assert rewards[-1] == 0
    assert len(rewards) < 30
    with pytest.raises(UserError, match=r"^no trial is going on: expected reset\(\)"):
        env.step(AHEAD)
    env.reset()
    env.step(AHEAD)


def test_a_trial_is_truncated_after_its_steps():
    env = make(steps=4).unwrapped
    env.reset(seed=1)
    ends = [env.step(np.zeros(2))[2:4] for _ in range(4)]
    assert ends == [(False, False)] * 3 + [(False, True)]
    with pytest.raises(UserError, match="no trial is going on"):
        env.step(AHEAD)


def test_trials_that_are_over_begin_anew_in_the_same_step():
    """As in Gymnasium's own vector environment, which steps one after the other."""
    starts = np.array([[0.35, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.3, 1.0]])
    ours = make_vec(3, steps=15)
    ours.reset(seed=1, options={"starts": starts})
    envs = SyncVectorEnv(
        [lambda: make(steps=15).unwrapped] * 3, autoreset_mode="SameStep"
    )
    envs.reset(seed=1)
    for env, start in zip(envs.envs, starts, strict=True):
        env.reset(options={"start": start})
    actions = np.array([[1.0, 0.0], [0.2, 0.5], [0.1, 0.0]])
    ends = []
    for k in range(15):
        seen, reward, crashed, over, infos = ours.step(actions)
        theirs = envs.step(actions)
        done = crashed | over
        first = ~np.isin(np.arange(3), [i for i, _ in ends])
        # their second trials begin elsewhere
        np.testing.assert_array_equal(seen[~done & first], theirs[0][~done & first])
        for mine, other in zip((reward, crashed, over), theirs[1:4], strict=True):
            np.testing.assert_array_equal(mine[first], other[first])
        if not (done & first).any():
            continue
        assert set(infos) == set(theirs[4])
        for i in np.flatnonzero(done & first):
            ends.append((int(i), k))
            # at a wall, or far from it as on a new start
            assert (infos["final_obs"][i].min() < 0.1) == crashed[i]
            assert seen[i].min() > 0.1
            assert infos["_final_obs"][i]
            np.testing.assert_array_equal(
                infos["final_obs"][i], theirs[4]["final_obs"][i]
            )
        assert all(last is None for last in infos["final_obs"][~done])
    assert [i for i, _ in ends] == [0, 1, 2]
    assert ends[0][1] < 14
    assert ends[1][1] == ends[2][1] == 14


def test_returned_arrays_share_no_memory():
    env = make_vec(4, steps=3)
    arrays = [env.reset(seed=0)[0]]
    for _ in range(7):
        seen, reward, crashed, over, infos = env.step(np.full((4, 2), 0.3))
        arrays += [seen, reward, crashed, over]
        if infos:
            arrays += [infos["_final_obs"], infos["_final_info"]]
            arrays += list(infos["final_obs"])
    kept = [array.copy() for array in arrays]
    for i, a in enumerate(arrays):
        assert not any(np.shares_memory(a, b) for b in arrays[i + 1 :])
        # nor with what is yet to come
        a.fill(0)
    again = make_vec(4, steps=3)
    np.testing.assert_array_equal(again.reset(seed=0)[0], kept[0])


def test_the_librarys_statistics_are_those_of_trials():
    env = RecordEpisodeStatistics(make_vec(3, steps=10))
    env.reset(seed=2)
    sums = np.zeros(3)
    over, infos = np.zeros(3, bool), {}
    while not over.any():
        _, reward, _, over, infos = env.step(np.tile([0.3, 0.1], (3, 1)))
        sums += reward
    assert over.all()
    np.testing.assert_allclose(infos["episode"]["r"], sums)
    assert (infos["episode"]["l"] == 10).all()


OWN = """
import numpy as np
def own(step):
    assert step.pose.shape == (*step.contact.shape, 3)
    assert step.clearance.shape == step.contact.shape
    assert np.shape(step.time) in ((), step.contact.shape)
    return np.broadcast_to(step.time, step.contact.shape) / 100
"""


def test_a_fitness_of_ones_own_is_the_reward(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    options = {"fitness": f"{tmp_path / 'own.py'}:own", "steps": 3}
    alone, many = make(**options), make_vec(2, **options)
    alone.reset(seed=0)
    many.reset(seed=0)
    rewards = [alone.step(np.zeros(2))[1] for _ in range(3)]
    assert rewards == pytest.approx([0.001, 0.002, 0.003])
    rewards = [many.step(np.zeros((2, 2)))[1] for _ in range(5)]
    expected = [0.001, 0.002, 0.003, 0.001, 0.002]
    np.testing.assert_allclose(rewards, np.tile(expected, (2, 1)).T)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"nois": "none"}, "unknown option 'nois'; available: robot, arena, steps, "),
        ({"max_steps": 3}, "unknown option 'max_steps'; available: robot, "),
        ({"robot": "khepera"}, "khepera"),
        ({"noise": "loud", "latency": 1}, "loud"),
        ({"robot": 3}, "robot: expected a text, got 3"),
        ({"arena": "nowhere"}, "nowhere"),
        ({"steps": 0}, "steps: expected a whole number from 1 to 10,000,000, got 0"),
        ({"steps": 2.5}, "steps: expected a whole number"),
        ({"control_step": -1}, "control_step: expected a number above 0"),
        ({"fitness": "fast"}, "unknown fitness 'fast'"),
        ({"fitness": None}, "fitness: expected a text, got None"),
        ({"v_max": 128}, "forward: expected a number above 0, at most 0.13 m/s"),
        ({"sensor_range": 40}, "sensor_range: expected a number above 0, at most 1 m"),
        ({"start_clearance": 0}, "start_clearance: expected a number above 0"),
        ({"noise": "loud"}, "unknown noise 'loud'; available: none, calibrated, "),
        ({"noise": 1}, "noise: expected a text, got 1"),
        ({"randomise": True}, "randomise needs noise: calibrated or strong, got none"),
        ({"randomise": 1}, "randomise: expected True or False, got 1"),
        ({"randomise_all": 0}, "randomise_all: expected True or False, got 0"),
        ({"randomise_all": True}, "randomise_all needs noise: calibrated or strong"),
        ({"calibration": "no.yaml", "noise": "strong"}, "no.yaml"),
        ({"calibration": 4}, "calibration: expected a path, got 4"),
        ({"latency": -1}, "latency: expected a whole number from 0 to 1,000"),
        ({"latency": 1, "noise": "strong"}, "latency: expected 0 with noise strong"),
        ({"threads": -1}, "threads: expected a whole number from 0 to"),
    ],
    ids=str,
)
@pytest.mark.parametrize("how", [make, lambda **options: make_vec(2, **options)])
def test_bad_options_are_one_line(how, options, message):
    with pytest.raises(UserError) as error:
        how(**options)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("n", [0, -3, 2.0, "4", None, True])
def test_a_number_of_robots_is_a_whole_number(n):
    with pytest.raises(UserError, match="num_envs: expected a whole number from 1 to"):
        FollowWallsVectorEnv(num_envs=n)


@pytest.mark.filterwarnings("ignore:.*render_mode.*:UserWarning")
def test_render_modes_that_do_not_exist():
    with pytest.raises(
        UserError, match=r"unknown render_mode 'ansi'; available: None, "
    ):
        make(render_mode="ansi")
    with pytest.raises(UserError, match=r"render_mode 'rgb_array'; available: None$"):
        make_vec(2, render_mode="rgb_array")
    with pytest.raises(UserError, match="width: expected a whole number from 1 to"):
        make(render_mode="rgb_array", width=0)


ACTIONS = [
    [np.nan, 0.0],
    [1.1, 0.0],
    [-0.1, 0.0],
    [0.0, -np.inf],
    [0.5, 1.0000001],
    [1.0],
    [[1.0, 0.0]],
    [1.0, [0.0]],
    ["1", "0"],
    [True, False],
    [1j, 0.0],
    [10**400, 0],
    "forward",
    None,
]


@pytest.mark.parametrize("action", ACTIONS, ids=str)
def test_actions_out_of_bounds_are_refused(action):
    env = make().unwrapped
    env.reset(seed=0)
    with pytest.raises(
        UserError, match=r"^expected actions of shape \(2,\), v from 0 "
    ):
        env.step(action)
    # as if nothing had been
    assert env.step([1, 0])[1] >= 0
    many = make_vec(2)
    many.reset(seed=0)
    with pytest.raises(UserError, match=r"^expected actions of shape \(2, 2\), v from"):
        many.step([action, action])


def test_what_is_out_of_bounds_is_said():
    env = make_vec(2)
    env.reset()
    with pytest.raises(UserError, match=r"got v = 1.5, w = 0$"):
        env.step([[0.5, 0.0], [1.5, 0.0]])


def test_starts_and_reset_options():
    env, many = make().unwrapped, make_vec(2)
    for bad in ([0.0, 0.0], [np.nan, 0, 0], "here", None):
        with pytest.raises(UserError, match=r"start: expected finite numbers of shape"):
            env.reset(options={"start": bad})
    with pytest.raises(UserError, match=r"of shape \(2, 3\)"):
        many.reset(options={"starts": [0.0, 0.0, 0.0]})
    with pytest.raises(UserError, match="unknown reset option 'starts'; available: st"):
        env.reset(options={"starts": [0.0, 0.0, 0.0]})
    with pytest.raises(UserError, match=r"expected reset\(\) before step\(\)"):
        make_vec(2).step(np.zeros((2, 2)))


def test_without_the_extra_one_line_says_how_to_get_it(monkeypatch):
    name = "epuck_mj.environments.gymnasium"
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, name)
    with pytest.raises(UserError, match=r"pip install 'epuck-mj\[gym\]'") as error:
        importlib.import_module(name)
    assert "\n" not in str(error.value)


def test_without_opengl_one_line_says_what_is_missing(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr(render, "find_library", lambda name: None)
    env = make(render_mode="rgb_array")
    env.reset(seed=0)
    with pytest.raises(UserError, match="no OpenGL to draw with") as error:
        env.render()
    assert "\n" not in str(error.value)
    env.close()


@needs_opengl
@pytest.mark.parametrize("robot", RUNGS)
def test_pictures(robot):
    size = {"width": 160, "height": 120}
    env = make(robot=robot, render_mode="rgb_array", **size)
    other = make(robot=robot, arena="round", render_mode="rgb_array", **size)
    start = {"options": {"start": [-0.2, 0.0, 0.0]}}
    env.reset(**start)
    other.reset(**start)
    first, elsewhere = env.render(), other.render()
    assert (first.shape, first.dtype) == ((120, 160, 3), np.uint8)
    for _ in range(20):
        env.step(AHEAD)
    later = env.render()
    # it has driven to the right, and the other one has not moved
    moved = np.abs(later.astype(int) - first).max(axis=-1) > 60
    assert 20 < moved.sum() < 0.1 * moved.size
    np.testing.assert_array_equal(other.render(), elsewhere)
    # nothing is left of the trial before
    env.reset(**start)
    np.testing.assert_array_equal(env.render(), first)
    env.close()
    np.testing.assert_array_equal(other.render(), elsewhere)
    other.close()
    check_env(make(robot=robot).unwrapped)


@needs_opengl
def test_who_forgets_to_close_hears_nothing():
    code = (
        "import gymnasium, epuck_mj.environments.gymnasium as g\n"
        "env = gymnasium.make(g.ID, render_mode='rgb_array')\n"
        "env.reset()\n"
        "assert env.render().std() > 0"
    )
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


def test_without_a_render_mode_nothing_is_drawn():
    env = FollowWallsEnv()
    env.reset(seed=0)
    assert env.render() is None
    env.close()


def test_the_page_says_what_works(tmp_path, monkeypatch):
    """Every Python block of the page runs, but for that of another library."""
    monkeypatch.chdir(tmp_path)
    page = (MODELS.parent / "docs" / "agents.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    ours = [block for block in blocks if "stable_baselines3" not in block]
    assert len(ours) >= 3
    for block in ours:
        exec(compile(block, "agents.md", "exec"), {})
