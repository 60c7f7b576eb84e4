"""What other systems lack is not needed: child processes from which it was taken away.

These tests do not stand for a try on those systems.
"""

import json
import re
import subprocess
import sys

import pytest

from tests.processes import PATIENCE, python_process
from tests.shipped import champion_file
from tests.test_architecture import COMMANDS

WITHOUT = """
import json, runpy, sys

missing, arguments = map(json.loads, sys.argv[1:3])
sys.modules.update(dict.fromkeys(missing))
"""
"""Start of a process without some modules; its arguments are in `arguments`."""

AS_A_COMMAND = """
sys.argv = arguments
runpy.run_module(arguments[0], run_name="__main__", alter_sys=True)
"""

WINDOWS = """
import os, select, signal, sys

for name in ("SIGHUP", "SIGQUIT", "SIGTSTP", "SIGKILL"):
    delattr(signal, name)
for name in ("openpty", "ttyname", "set_blocking", "fork", "getuid"):
    delattr(os, name)
true_select = select.select

def select_like_windows(*lists):
    # an OSError is what Windows answers: documentation of Python's select
    if not any(lists[:3]):
        raise OSError(10022, "an invalid argument was supplied")
    return true_select(*lists)

select.select = select_like_windows
"""
"""What Python's documentation says that Windows has not, or does otherwise."""

POSIX_MODULES = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")

DM_CONTROL = ("dm_control", "dm_env", "labmaze")


def like_windows(*arguments: str) -> list[str]:
    """Arguments of a Python process that runs a module without what Windows lacks."""
    # other people's packages have files of their own for each system
    code = f"import filelock, psutil, serial\n{WITHOUT}{WINDOWS}{AS_A_COMMAND}"
    return ["-W", "error", "-c", code, json.dumps(POSIX_MODULES), json.dumps(arguments)]


@pytest.mark.slow
def test_the_emulated_robot_and_a_drive_without_terminals(alone):
    emulated = ["epuck_mj.bridge.fake", "--tcp", "0", "--scenario", "disconnect@99"]
    with python_process(*like_windows(*emulated)) as robot:
        assert robot.stdout is not None
        said = ""
        while "port: " not in said:
            line = robot.stdout.readline()
            assert line, robot.communicate(timeout=PATIENCE)
            said += line
        port = said.partition("port: ")[2].strip()
        drive = ["epuck_mj.bridge", str(champion_file()), "--port", port]
        with python_process(
            *like_windows(*drive, "--seconds", "1", "--log", "drive")
        ) as bridge:
            out, error = bridge.communicate(timeout=PATIENCE)
    assert (bridge.returncode, error) == (0, "")
    assert "ended" in out


def test_without_pseudo_terminals_one_line_says_what_to_use():
    with python_process(*like_windows("epuck_mj.bridge.fake")) as process:
        _, error = process.communicate(timeout=PATIENCE)
    expected = "error: this system has no pseudo-terminals: use --tcp PORT\n"
    assert (process.returncode, error) == (2, expected)


WITHOUT_DM_CONTROL = """
import importlib
import epuck_mj, evolution
from epuck_mj.environments.gymnasium import FollowWallsEnv
from evolution.run.__main__ import evolve

for command in arguments[1:]:
    importlib.import_module(command)
for package in (epuck_mj, evolution):
    for name in sorted(set(package.__all__) - {"load", "SUITE"}):
        getattr(package, name)
assert evolution.load
FollowWallsEnv(robot="epuck").reset(seed=1)
run = f"{arguments[0]} --population 10 --steps 10 --trials 1 --evaluations 60"
few = "--climb 0.5 --validation-starts 2 --test-starts 2 --output run"
assert evolve(f"{run} {few}".split()) == 0
try:
    epuck_mj.load("follow_walls")
except ImportError as error:
    print("the task:", error)
"""


@pytest.mark.slow
def test_all_but_the_task_runs_without_dm_control(alone):
    """So it does with a version of MuJoCo that dm_control does not run on."""
    arguments = ["de-best", *COMMANDS]
    code = WITHOUT + WITHOUT_DM_CONTROL
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(DM_CONTROL), json.dumps(arguments)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the task: import of dm_control halted" in done.stdout
    assert re.search(r"On epuck_kinematic \d", done.stdout)
