"""A champion in MuJoCo's own viewer: `python -m epuck_mj.view my.xml champion.json`.

The champion drives at real time, trial after trial on new starts, until the window is
closed. A crash ends a trial. A trial in the window is bit-identical to the trajectory
of `epuck_mj.trials.recorder.record` from the same start.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, pose_flag, word
from epuck_mj.host.files import is_file
from epuck_mj.host.limits import check_flag
from epuck_mj.host.yaml_and_json import read_yaml
from epuck_mj.policies.file import champion_file, load_controller
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.scene.model_files import is_kinematic
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.condition_flags import ConditionFlags
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import START_CLEARANCE, Policy, TaskParameters
from epuck_mj.step.disturbances import Disturbances

if TYPE_CHECKING:
    from epuck_mj.scene.model import Scene


EXAMPLES = (
    "python -m epuck_mj.view arena runs/ga-seed-1/champion.json",
    "python -m epuck_mj.view my.xml --seconds 30",
)


@dataclass(frozen=True)
class Options:
    """Watch a controller drive in MuJoCo's viewer until the window is closed."""

    arena: tyro.conf.Positional[Annotated[str, word("ARENA")]]
    """name of a shipped arena, or path of an MJCF file"""
    champion: tyro.conf.Positional[Annotated[Path | None, word("RUN")]] = None
    """directory of a finished run, or controller file; by default the hand-written wall
    follower"""
    robot: Annotated[str, word("ROBOT")] = "epuck"
    """name of a shipped robot, or path of an MJCF file"""
    pose: Annotated[tuple[float, float, float] | None, word("X Y DEGREES")] = None
    """start of every trial: x, y [m] and heading [degrees]; random starts by default"""
    seconds: Annotated[float | None, word("SECONDS")] = None
    """duration of a trial [s]; the controller's own by default"""
    seed: int = 0
    """seed of random starts and noise"""
    robots: ConditionFlags = field(default_factory=ConditionFlags)
    """noise and differences of the robot; by default those of the champion's run"""


def view(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(Options, "python -m epuck_mj.view", argv, examples=EXAMPLES)
    check_flag("seed", options.seed)
    policy: Policy = WallFollower()
    task = TaskParameters()
    conditions = options.robots.conditions
    if options.champion is not None:
        champion = champion_file(options.champion)
        file = load_controller(champion)
        policy, task = file.controller, file.task
        conditions = conditions or _evolved_with(champion)
    if options.seconds is not None:
        check_flag("seconds", options.seconds)
        steps = round(options.seconds / task.control_step)
        if steps < 1:
            raise UserError(
                f"expected --seconds of at least a control step, "
                f"{task.control_step:g} s, got {options.seconds:g}"
            )
        task = replace(task, steps=steps)
    if is_kinematic(options.robot):
        print(f"{options.robot} is shown on wheels, as MuJoCo moves it", flush=True)
    # slow to import: after the checks of the command line
    from epuck_mj.rungs.watched_robot import WatchedRobot
    from epuck_mj.scene.model import load_scene
    from epuck_mj.view.window import open_window, watch

    scene = load_scene(options.robot, options.arena, task.control_step)
    starts = _starts(scene, options)
    robot, first = WatchedRobot(scene), next(starts)
    # the window shows it before the first trial begins
    robot.reset(first[None])
    starts = itertools.chain([first], starts)
    noise = np.random.default_rng([options.seed, 1])

    def meet() -> Disturbances | None:
        return None if conditions is None else conditions.draw(noise, 1, task.steps)

    if conditions is not None and conditions.noise != "none":
        print(f"driving with {conditions}", flush=True)
    with open_window(robot.model, robot.data) as window:
        for line in watch(window, robot, policy, starts, task, meet):
            print(line, flush=True)
    return 0


def _evolved_with(champion: Path) -> Conditions | None:
    """Conditions of a champion's robots, from the config.yaml beside its file."""
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
            fields.get("randomise_all", False),
        )
    except (KeyError, ValueError) as error:
        raise UserError(f"'{config}' is not the config of a run: {error}") from None


def _starts(scene: "Scene", options: Options) -> Iterator[np.ndarray]:
    """Endless starts of trials.

    Raises:
        UserError: if the arena has no room, or the pose is not one.
    """
    pose = pose_flag(options.pose)
    if pose is not None:
        return itertools.repeat(np.array(pose))
    from epuck_mj.scene.starts import FreeSpace

    space, rng = FreeSpace(scene, START_CLEARANCE), np.random.default_rng(options.seed)
    return (space.sample(rng, 1)[0] for _ in itertools.count())


if __name__ == "__main__":
    main(view)
