"""Shared by all tests: the shipped robot in the paper's arena, in each simulator."""

import os
import signal
from pathlib import Path

# rerun: no analytics, and warnings about bad data are errors
os.environ["CI"] = "1"
os.environ["RERUN_STRICT"] = "1"

# as in the project's commands: MuJoCo and dm_control look for no display
os.environ.setdefault("MUJOCO_GL", "disabled")

import numpy as np
import pytest

from epuck_mj.host.interruption import SIGNALS
from epuck_mj.policies.network import Network
from epuck_mj.rungs.table import RUNGS, compiled_trials, robots_in
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from epuck_mj.step.control import TaskParameters

# ignored where tests run in the background of a script, and by all that they start
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kinematic robot once, before each process of the tests would.

    Processes that are killed while they compile leave nothing behind.
    """
    if not hasattr(config, "workerinput"):
        scene, task = load_scene(KINEMATIC_ROBOT, "arena"), TaskParameters(steps=1)
        trials, network = compiled_trials(scene, task, 1), Network()
        assert trials is not None
        nothing = network.decode(np.zeros((1, network.n_genes)))
        trials(nothing, np.zeros((1, 3)), None, 1, np.full(1, -np.inf))
        _move_once(scene)


def _move_once(scene: Scene) -> None:
    robots = robots_in(scene, 1, 1)
    robots.reset(np.zeros((1, 3)))
    robots.step(np.zeros((1, 2)))


@pytest.fixture
def alone(tmp_path, monkeypatch):
    """A working directory of its own on a machine without display or network."""
    for name in list(os.environ):
        if name in ("DISPLAY", "WAYLAND_DISPLAY", "RERUN") or name.startswith("XDG_"):
            monkeypatch.delenv(name)
    for name, value in {
        "CI": "1",
        "RERUN_STRICT": "1",
        "RUST_LOG": "error",
        "HOME": str(tmp_path),
        "XDG_RUNTIME_DIR": str(tmp_path),
        "HTTPS_PROXY": "http://127.0.0.1:9",
        "NO_PROXY": "127.0.0.1,localhost",
        "PYTHONPATH": str(Path(__file__).parent.parent),
    }.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session", params=RUNGS)
def scene(request) -> Scene:
    """Each shipped robot, in turn."""
    return load_scene(request.param, "arena")


@pytest.fixture(scope="session")
def wheels() -> Scene:
    """The shipped robot that MuJoCo moves."""
    return load_scene(WHEELED_ROBOT, "arena")


@pytest.fixture(scope="session")
def kinematic() -> Scene:
    """The cheap one, compiled: tests in real time have no time for that."""
    scene = load_scene(KINEMATIC_ROBOT, "arena")
    _move_once(scene)
    return scene


@pytest.fixture
def handlers():
    """The handlers of the signals that end a drive, which are there again later."""
    before = {signum: signal.getsignal(signum) for signum in SIGNALS}
    yield before
    for signum, handler in before.items():
        signal.signal(signum, handler)
