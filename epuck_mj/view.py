"""A champion in MuJoCo's own viewer: `python -m epuck_mj.view my.xml champion.json`.

It drives at real time, trial after trial on new starts, until the window is closed. A
crash ends a trial. What the window shows is the trial itself, step by step: the same
start gives the trajectory of `epuck_mj.trials.recorder.record`, to the last bit.
"""

import importlib
import itertools
import re
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse
from epuck_mj.host.files import is_file
from epuck_mj.host.yaml_and_json import read_yaml
from epuck_mj.policies.file import load
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.single import WatchedRobot
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.conditions import Conditions, NoiseLevel
from epuck_mj.step.control import START_CLEARANCE, Policy, TaskParameters, drive
from epuck_mj.step.disturbances import Disturbances

LATE_MAX = 0.2
"""How late the picture may be before time that was lost is given up [s]."""

CLOSING_MAX = 5.0
"""How long the viewer's own thread may take to end [s]."""


@dataclass(frozen=True)
class Options:
    """Watch a controller drive in MuJoCo's viewer, until its window is closed."""

    arena: tyro.conf.Positional[str]
    """name of a shipped arena, or path of an MJCF"""
    champion: tyro.conf.Positional[Path | None] = None
    """controller file (JSON); the wall follower written by hand by default"""
    robot: str = "epuck"
    """name of a shipped robot, or path of an MJCF"""
    pose: tuple[float, float, float] | None = None
    """start of every trial: x, y [m], heading [degrees]; random ones by default"""
    seconds: float | None = None
    """duration of a trial [s]; the controller's own by default"""
    seed: int = 0
    """seed of the random starts and of noise"""
    noise: NoiseLevel | None = None
    """none for ideal sensors and motors, calibrated or strong for real ones; as the
    champion evolved, if its config.yaml is beside it, by default"""
    randomise: bool = False
    """another robot in each trial; needs noise"""
    calibration: Path | None = None
    """file of python -m epuck_mj.calibrate: that robot in all trials; needs noise"""


class Clock:
    """Lets simulated time pass no faster than real time."""

    def __init__(self) -> None:
        """Start now."""
        self._due = time.perf_counter()

    def wait(self, seconds: float) -> None:
        """Sleep until that much time has passed since the last call."""
        self._due += seconds
        left = self._due - time.perf_counter()
        if left > 0:
            time.sleep(left)
        elif left < -LATE_MAX:
            # after a pause of the machine, no rush to catch up
            self._due = time.perf_counter()


def watch(
    window: Any,
    robot: WatchedRobot,
    policy: Policy,
    starts: Iterator[np.ndarray],
    task: TaskParameters,
    meet: Callable[[], Disturbances | None] = lambda: None,
) -> Iterator[str]:
    """Trials in a window until it is closed or no start is left; a line for each.

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
            f"trial {number}: fitness {fitness:.1f} of {task.steps}, {end} after "
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
        yield window
    finally:
        window.close()
        # GLFW ends with the process, and must not do so below the viewer's thread
        for thread in set(threading.enumerate()) - others:
            thread.join(CLOSING_MAX)


def run(argv: Sequence[str]) -> int:
    """Watch; the exit status.

    Raises:
        UserError: for anything a user can put right.
    """
    options = parse(Options, "python -m epuck_mj.view", argv)
    policy: Policy = WallFollower()
    task = TaskParameters()
    conditions = Conditions.asked(options.noise, options.randomise, options.calibration)
    if options.champion is not None:
        file = load(options.champion)
        policy, task = file.controller, file.task
        conditions = conditions or _evolved_with(options.champion)
    if options.seconds is not None:
        ratio = options.seconds / task.control_step
        if not 0.5 <= ratio < float("inf"):
            raise UserError(
                f"expected --seconds of at least a control step, "
                f"{task.control_step:g} s, got {options.seconds:g}"
            )
        task = replace(task, steps=round(ratio))
    scene = load_scene(options.robot, options.arena, task.control_step)
    starts = _starts(scene, options)
    robot, first = WatchedRobot(scene), next(starts)
    # the window shows it before the first trial begins
    robot.reset(first[None])
    starts = itertools.chain([first], starts)
    noise = np.random.default_rng([options.seed, 1])

    def meet() -> Disturbances | None:
        return None if conditions is None else conditions.draw(noise, 1, task.steps)

    if conditions is not None and meet() is not None:
        print(f"driving with {conditions}", flush=True)
    with open_window(robot.model, robot.data) as window:
        with window.lock():
            # rays go on for ever; controllers see four centimetres of them
            window.opt.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
        for line in watch(window, robot, policy, starts, task, meet):
            print(line, flush=True)
    return 0


def _evolved_with(champion: Path) -> Conditions | None:
    """What a champion's robots were like, as the config of its run beside it says."""
    config = champion.with_name("config.yaml")
    if not is_file(config):
        return None
    fields = read_yaml(config)
    calibration = fields.get("calibration")
    try:
        return Conditions(
            fields.get("noise", "none"),
            fields.get("randomise", False),
            None if calibration is None else Calibration.from_dict(calibration),
        )
    except (KeyError, ValueError) as error:
        raise UserError(f"'{config}' is no config of a run: {error}") from None


def _starts(scene: Scene, options: Options) -> Iterator[np.ndarray]:
    """Where trials start, for ever.

    Raises:
        UserError: if the arena has no room, or the pose is not one.
    """
    if options.seed < 0:
        raise UserError(f"expected --seed of 0 or more, got {options.seed}")
    if options.pose is not None:
        pose = np.array(options.pose)
        if not np.isfinite(pose).all():
            raise UserError(f"expected --pose of three numbers, got {options.pose}")
        pose[2] = np.radians(pose[2])
        return itertools.repeat(pose)
    space, rng = FreeSpace(scene, START_CLEARANCE), np.random.default_rng(options.seed)
    return (space.sample(rng, 1)[0] for _ in itertools.count())


if __name__ == "__main__":
    main(run)
