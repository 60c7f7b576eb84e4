"""Shared by all tests: the shipped robot in the paper's arena, in each simulator."""

import gc
import os
import signal
from pathlib import Path

# rerun: no analytics, and warnings about bad data are errors
os.environ["CI"] = "1"
os.environ["RERUN_STRICT"] = "1"

# as in the project's commands: MuJoCo and dm_control look for no display, and the
# linear algebra of small matrices runs on one thread
os.environ.setdefault("MUJOCO_GL", "disabled")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

from epuck_mj.host.interruption import SIGNALS
from epuck_mj.policies.network import Network
from epuck_mj.rungs.table import RUNGS, compiled_trials, robots_in
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from epuck_mj.step.control import TaskParameters

IN_REAL_TIME = ("bridge", "fleet", "hostile_peers", "calibrate", "fake", "live")
LONG = ("extending", "cluster", "signals", "study", "lesson", "drive_fit", "notebook")
LONG += ("run", "systems", "kinematic", "replay_processes", "verify", "climb", "check")
"""Names of files with such tests."""

# ignored where tests run in the background of a script, and by all that they start
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    # by `nohup`
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kinematic robot once, before each process of the tests would.

    Processes that are killed while they compile leave nothing behind.
    """
    # what is imported for all tests stays: nobody has to look through it for garbage
    gc.disable()
    # the first worker has what is in real time: the others wait for it
    if getattr(config, "workerinput", {}).get("workerid", "gw0") != "gw0":
        os.nice(10)
    if not hasattr(config, "workerinput"):
        scene, task = load_scene(KINEMATIC_ROBOT, "arena"), TaskParameters(steps=1)
        trials, network = compiled_trials(scene, task, 1), Network()
        assert trials is not None
        nothing = network.decode(np.zeros((1, network.n_genes)))
        trials(nothing, np.zeros((1, 3)), None, 1, np.full(1, -np.inf))
        _move_once(scene)


def pytest_collection_finish() -> None:
    """Collect garbage of the tests only."""
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let each worker of `--dist worksteal` begin with what takes long.

    It begins with an equal part of all tests in their order. What is in real time, and
    hardly needs a processor, is all at one of them.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    parts: list[list[pytest.Item]] = [[] for _ in range(workers)]
    others: list[pytest.Item] = []
    for item in items:
        name = item.path.stem.removeprefix("test_")
        if name in IN_REAL_TIME:
            parts[0].append(item)
        elif name in LONG and workers > 1:
            parts[1 + LONG.index(name) % (workers - 1)].append(item)
        else:
            others.append(item)
    left = len(items)
    for number, part in enumerate(parts):
        size = left // (workers - number)
        n_more = max(size - len(part), 0)
        part += others[:n_more]
        del others[:n_more]
        left -= size
    items[:] = [item for part in parts for item in part] + others


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
