"""A policy drives a real robot: `python -m epuck_mj.bridge CHAMPION --port PORT`."""

import gc
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.bridge.failures import RUNAWAY
from epuck_mj.bridge.line.connect import connect
from epuck_mj.bridge.line.last_resort import leave_to_last_resort
from epuck_mj.bridge.line.serial_port import ports
from epuck_mj.constants import SPEED_MAX
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, word
from epuck_mj.host.output import say
from epuck_mj.policies.file import load_controller
from epuck_mj.policies.wall_follower import YARDSTICK, WallFollower
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import Policy, TaskParameters

MODULE = "epuck_mj.bridge"
SECONDS_MAX = 24 * 3600


EXAMPLES = (
    "python -m epuck_mj.bridge runs/ga-seed-1 --port /dev/rfcomm0",
    "python -m epuck_mj.bridge wall-follower --port COM5 --seconds 20",
)


@dataclass(frozen=True)
class Options:
    """Let a controller drive a real e-puck, and stop the robot at the end.

    Attributes:
        champion: directory of a finished run, controller file, or wall-follower, the
            hand-written controller.
        port: port of the robot: /dev/rfcomm0, COM5 or socket://host:port; for an
            e-puck2 over WiFi tcp://host:1000.
        seconds: duration of the drive [s].
        calibrate: first let the robot set its sensors' zero; nothing may be near it.
        calibration: file written by python -m epuck_mj.calibrate for this robot.
        pose: start of the robot in the log: x and y [m] and heading [degrees].
        max_speed: highest speed of a wheel [m/s]; the robot's own limit if not given.
        dry_run: read the sensors and compute commands, but do not move.
        arena: arena to show the log in; if not given, the one the champion evolved in.
        log: name of the log, written as .npz and .rrd; a name in runs/ if not given.
        list_ports: list the serial ports of this computer and exit.
    """

    champion: tyro.conf.Positional[Annotated[str, word("RUN")]] = ""
    port: Annotated[str, word("PORT")] = ""
    seconds: Annotated[float, word("SECONDS")] = 60.0
    calibrate: bool = False
    calibration: Annotated[Path | None, word("FILE")] = None
    pose: Annotated[tuple[float, float, float], word("X Y DEGREES")] = (0.0, 0.0, 0.0)
    max_speed: Annotated[float | None, word("METRES")] = None
    dry_run: bool = False
    arena: Annotated[str | None, word("ARENA")] = None
    log: Annotated[Path | None, word("FILE")] = None
    list_ports: bool = False


def bridge(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    if options.list_ports:
        for name, description in ports():
            say(f"{name}  {description}")
        return 0
    _refuse_bad_options(options)
    policy, task, robot, arena = _champion(options.champion)
    # physics and pictures are not for those who only ask for help
    from epuck_mj.bridge.drive.log import log_name
    from epuck_mj.bridge.drive.mission import Mission, accomplish
    from epuck_mj.scene.model import load_scene

    calibration = options.calibration
    x, y, degrees = options.pose
    mission = Mission(
        policy=policy,
        task=task,
        scene=load_scene(robot, options.arena or arena, task.control_step),
        calibration=Calibration.load(calibration) if calibration else Calibration(),
        n_steps=max(1, round(options.seconds / task.control_step)),
        start=(x, y, math.radians(degrees)),
        speed_max=options.max_speed or float("inf"),
        dry_run=options.dry_run,
        calibrate=options.calibrate,
        log=log_name(options.log),
    )
    # no search for garbage among what was loaded, neither as it drives nor as it ends
    gc.freeze()
    status = accomplish(mission, lambda: connect(options.port), time.monotonic)
    if status == RUNAWAY:
        leave_to_last_resort(options.port)
    return status


def _refuse_bad_options(options: Options) -> None:
    if not options.champion:
        raise UserError(f"expected a controller file or {YARDSTICK}")
    if not options.port:
        raise UserError("expected --port; --list-ports lists the ports there are")
    if not 0 < options.seconds <= SECONDS_MAX:
        raise UserError(
            f"expected --seconds above 0, up to {SECONDS_MAX}, got {options.seconds}"
        )
    if options.max_speed is not None and not 0 < options.max_speed <= SPEED_MAX:
        raise UserError(
            f"expected --max-speed above 0, up to {SPEED_MAX:.4f} m/s, "
            f"got {options.max_speed}"
        )
    if not all(map(math.isfinite, options.pose)):
        raise UserError(f"expected --pose of finite numbers, got {options.pose}")


def _champion(name: str) -> tuple[Policy, TaskParameters, str, str]:
    """Policy, task, robot and arena of a champion."""
    if name == YARDSTICK:
        return WallFollower(), TaskParameters(), "epuck", "arena"
    file = load_controller(name)
    return file.controller, file.task, file.origin.robot, file.origin.arena


if __name__ == "__main__":
    main(bridge)
