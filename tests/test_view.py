"""The viewer's trials: those of `record` to the last bit, with a window or without."""

import itertools
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.watched_robot import WatchedRobot
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import MODELS
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters, drive
from epuck_mj.trials.recorder import record
from epuck_mj.view import __main__ as view
from epuck_mj.view import window as windows
from tests.processes import PATIENCE

TASK = TaskParameters(steps=120)


def straight_on(observation):
    action = np.zeros((*observation.shape[:-1], 2))
    action[..., 0] = 1.0
    return action


@pytest.fixture
def champion(tmp_path):
    genome = np.random.default_rng(1).normal(size=Network().n_genes)
    origin = Origin("epuck", "arena")
    file = ControllerFile(Network(), genome, TaskParameters(), origin, {})
    path = tmp_path / "champion.json"
    path.write_text(file.to_json())
    return path


@pytest.mark.parametrize("policy", [WallFollower(), straight_on])
@pytest.mark.parametrize("noise", ["none", "strong"])
def test_a_trial_is_the_one_that_record_gives(policy, noise):
    scene = load_scene("epuck", "pillars")
    watched = WatchedRobot(scene)
    # one robot for all trials: a reset leaves nothing of the one before
    starts = FreeSpace(scene, 0.01).sample(np.random.default_rng(0), 4)
    conditions = Conditions(noise, randomise=noise != "none")
    met = conditions.draw(np.random.default_rng(1), len(starts), TASK.steps)
    for i, start in enumerate(starts):
        own = None if met is None else met[i : i + 1]
        recorded = record(scene, policy, start, TASK, own)
        living = disturbed(watched, own, TASK.control_step)
        steps = list(drive(living, policy, living.reset(start[None]), TASK))
        for name in ("action", "command", "fitness"):
            done = np.concatenate([getattr(step, name) for step in steps])
            np.testing.assert_array_equal(done, getattr(recorded, name))
        seen = np.concatenate([step.observation for step in steps])
        np.testing.assert_array_equal(seen, recorded.observation[1:])
        if own is None:
            # an ideal robot has the scene's body and its limits
            limits = watched.model.actuator_ctrlrange
            np.testing.assert_array_equal(limits, scene.model.actuator_ctrlrange)
            distance = np.concatenate([step.reading.distance for step in steps])
            np.testing.assert_array_equal(distance, recorded.distance[1:])
        pose = scene.poses(watched.data.qpos)
        np.testing.assert_array_equal(pose, recorded.pose[-1])
        assert steps[-1].reading.contact[0] == recorded.crashed


class FakeWindow:
    """Closes after some pictures."""

    def __init__(self, pictures):
        self.left = pictures

    def sync(self):
        self.left -= 1

    def is_running(self):
        return self.left > 0


def test_trials_follow_each_other_until_the_window_is_closed(monkeypatch):
    monkeypatch.setattr(windows.time, "sleep", lambda seconds: None)
    scene, start = load_scene("epuck", "arena"), np.array([0.4, 0, 0])
    task = TaskParameters(steps=20)
    expected = record(scene, straight_on, start, task)
    assert expected.crashed
    window, robot = FakeWindow(400), WatchedRobot(scene)
    starts = itertools.repeat(start)
    lines = list(windows.watch(window, robot, straight_on, starts, task))
    # a crash ends a trial, and the same start gives the same trial again
    pictures = expected.steps * scene.n_substeps + 1
    # the last was not over when the window was closed
    assert len(lines) == 399 // pictures
    for number, line in enumerate(lines, 1):
        assert line == (
            f"trial {number}: fitness {expected.trial_fitness:.1f} of 20, crash after "
            f"{expected.steps * 0.1:.1f} s"
        )
    assert window.left <= 0


def test_simulated_time_is_real_time(monkeypatch):
    now = 0.0

    def sleep(seconds):
        nonlocal now
        now += seconds

    monkeypatch.setattr(windows.time, "perf_counter", lambda: now)
    monkeypatch.setattr(windows.time, "sleep", sleep)
    clock = windows.Clock()
    for work in (0.0, 0.004, 0.015, 0.0):
        now += work
        clock.wait(0.01)
    assert now == pytest.approx(0.04)
    # time that was lost is not made up for
    now += 100
    clock.wait(0.01)
    clock.wait(0.01)
    assert now == pytest.approx(100.05)


def run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, "-m", "epuck_mj.view", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        cwd=MODELS.parent,
        env={**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": "", **environment},
    )


def test_no_display_is_one_line_and_status_2(champion):
    result = run("arena", champion, "--pose", 0, 0, 90)
    assert (result.returncode, result.stdout) == (2, "")
    assert re.fullmatch(r"error: cannot open a window[^\n]*\n", result.stderr)


def test_a_runs_folder_is_its_champion_with_the_noise_it_evolved_with(
    champion, tmp_path, monkeypatch, capsys
):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    folder = tmp_path / "run"
    folder.mkdir()
    shutil.copy(champion, folder / "champion.json")
    (folder / "config.yaml").write_text("noise: calibrated\n")
    for given in (folder, folder / "champion.json"):
        with pytest.raises(UserError, match="cannot open a window"):
            view.view(["arena", str(given)])
        assert "driving with noise calibrated" in capsys.readouterr().out


def test_bad_input_is_one_line(champion, capsys):
    for arguments, message in [
        (("moon",), "no arena 'moon'"),
        (("arena", "none.json"), "cannot read"),
        (("arena", champion, "--robot", "r2d2"), "no robot 'r2d2'"),
        (("arena", "--pose", "nan", 0, 0), "--pose"),
        (("arena", "--seconds", 0), "--seconds"),
        (("arena", "--seconds", "inf"), "--seconds"),
    ]:
        with pytest.raises(UserError) as error:
            view.view([str(argument) for argument in arguments])
        assert "\n" not in str(error.value)
        assert message in str(error.value)
        assert capsys.readouterr() == ("", "")


def test_starts_are_those_asked_for():
    scene = load_scene("epuck", "arena")
    options = view.Options("arena", pose=(0.1, 0.2, 90.0))
    starts = view._starts(scene, options)
    for _ in range(2):
        np.testing.assert_allclose(next(starts), [0.1, 0.2, np.pi / 2])
    first, second = (
        [next(s) for _ in range(3)]
        for s in (view._starts(scene, view.Options("arena", seed=4)) for _ in "ab")
    )
    np.testing.assert_array_equal(first, second)
    assert len(np.unique(first, axis=0)) == 3


@pytest.fixture
def display():
    """A screen that nobody sees."""
    if not shutil.which("Xvfb"):
        pytest.skip("no Xvfb to open a window on")
    reading, writing = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x600x24"],
        pass_fds=[writing],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    with os.fdopen(reading) as file:
        number = file.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait(10)


WINDOW = """
import sys
from epuck_mj.view import __main__ as view, window as windows
from epuck_mj.host.command_line import main

open_window = windows.open_window
def closing(model, data):
    with open_window(model, data) as window:
        frames = 0
        sync = window.sync
        def counted():
            nonlocal frames
            frames += 1
            sync()
            if frames == 30:
                window.close()
        window.sync = counted
        yield window
windows.open_window = __import__("contextlib").contextmanager(closing)
main(view.view)
"""


def test_a_window_opens_shows_the_robot_and_closes(display, champion):
    result = subprocess.run(
        [sys.executable, "-c", WINDOW, "arena", str(champion), "--seconds", "0.1"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        cwd=MODELS.parent,
        env={**os.environ, "DISPLAY": display},
    )
    if "cannot open a window" in result.stderr:
        pytest.skip(f"no OpenGL on Xvfb: {result.stderr}")
    assert (result.returncode, result.stderr) == (0, "")
    # 30 pictures of 10 ms: trials of 0.1 s and one for each reset
    assert [line.split(":")[0] for line in result.stdout.splitlines()] == [
        "trial 1",
        "trial 2",
    ]


def test_ctrl_c_ends_it_without_a_word(display):
    process = subprocess.Popen(
        [sys.executable, "-m", "epuck_mj.view", "arena", "--seconds", "0.1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=MODELS.parent,
        env={**os.environ, "DISPLAY": display},
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    process.send_signal(2)
    _, errors = process.communicate(timeout=PATIENCE)
    if "cannot open a window" in errors:
        pytest.skip(f"no OpenGL on Xvfb: {errors}")
    assert line.startswith("trial 1: ")
    assert (process.returncode, errors) == (130, "")


def test_without_glfw_one_line_says_so(monkeypatch):
    def missing(name):
        raise ImportError(f"no {name}")

    monkeypatch.setattr(windows.importlib, "import_module", missing)
    scene = load_scene("epuck", "arena")
    robot = WatchedRobot(scene)
    with (
        pytest.raises(UserError, match="cannot open a window"),
        windows.open_window(robot.model, robot.data),
    ):
        pass
