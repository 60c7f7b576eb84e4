"""MuJoCo's viewer in a window at real time."""

import importlib
import re
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.watched_robot import WatchedRobot
from epuck_mj.step.control import Policy, TaskParameters, drive
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.step.fitness import of_most

LATE_MAX = 0.2
"""Delay of the picture beyond which lost time is not made up for [s]."""

CLOSING_MAX = 5.0
"""How long the viewer's own thread may take to end [s]."""


class Clock:
    """Clock that lets simulated time pass no faster than real time."""

    def __init__(self) -> None:
        """Start the clock."""
        self._due = time.perf_counter()

    def wait(self, seconds: float) -> None:
        """Sleep until that much time has passed since the last call."""
        self._due += seconds
        left = self._due - time.perf_counter()
        if left > 0:
            time.sleep(left)
        elif left < -LATE_MAX:
            # after a pause of the computer, do not catch up
            self._due = time.perf_counter()


def watch(
    window: Any,
    robot: WatchedRobot,
    policy: Policy,
    starts: Iterator[np.ndarray],
    task: TaskParameters,
    meet: Callable[[], Disturbances | None] = lambda: None,
) -> Iterator[str]:
    """Show trials in a window until it closes or no start is left; yield a line each.

    Args:
        window: MuJoCo's handle of its viewer: `sync`, `is_running`.
        robot: the one that the window shows.
        policy: called with observations `(1, 8)`, gives actions `(1, 2)`.
        starts: poses `(3,)`: x, y [m], yaw [rad].
        task: what a trial is.
        meet: draws what the next trial meets; None for an ideal robot.
    """
    clock, step = Clock(), robot.scene.model.opt.timestep

    def show() -> None:
        window.sync()
        clock.wait(step)

    robot.moved = show
    for number, start in enumerate(starts, 1):
        fitness, crashed, n_steps = 0.0, False, 0
        living = disturbed(robot, meet(), task.control_step)
        for done in drive(living, policy, living.reset(start[None]), task):
            fitness += float(done.fitness[0])
            crashed, n_steps = bool(done.reading.contact[0]), n_steps + 1
            if not window.is_running():
                return
        end = "crash" if crashed else "no crash"
        yield (
            f"trial {number}: fitness {of_most(fitness, task.most)}, {end} after "
            f"{n_steps * task.control_step:.1f} s"
        )


@contextmanager
def open_window(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[Any]:
    """MuJoCo's passive viewer on a model and its state, until the block ends.

    Raises:
        UserError: if there is no display, or no OpenGL on it.
    """
    others = set(threading.enumerate())
    try:
        # looks for libraries: only here
        glfw, viewer = map(importlib.import_module, ("glfw", "mujoco.viewer"))
        with warnings.catch_warnings():
            # the exception says the same
            warnings.simplefilter("error")
            # asked first: the viewer's own thread would die and be waited for
            if not glfw.init():
                raise RuntimeError("GLFW cannot be initialised")
            # that OpenGL is there as well shows only with a window
            glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
            glfw.destroy_window(glfw.create_window(64, 64, "", None, None))
            glfw.default_window_hints()
        window = viewer.launch_passive(model, data, show_right_ui=False)
    except Exception as problem:  # whatever libraries and drivers come up with
        reason = re.sub(r"^\(\d+\) b'(.*)'$", r"\1", " ".join(str(problem).split()))
        raise UserError(
            f"cannot open a window ({reason}): expected a display with OpenGL; "
            "without one, python -m evolution.replay draws pictures"
        ) from None
    try:
        with window.lock():
            # rays have no end; controllers see four centimetres of them
            window.opt.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
        yield window
    finally:
        window.close()
        # GLFW ends with the process, and must not do so below the viewer's thread
        for thread in set(threading.enumerate()) - others:
            thread.join(CLOSING_MAX)
