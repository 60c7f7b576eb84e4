"""Orders: what a robot is to do, in plain values that another process can be told."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

from epuck_mj.bridge.drive.mission import Mission
from epuck_mj.policies.file import load_controller
from epuck_mj.policies.wall_follower import YARDSTICK, WallFollower
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import Policy, TaskParameters


@dataclass(frozen=True)
class Order:
    """A drive of one robot in plain values.

    Attributes:
        port: of the robot.
        controller: directory of a finished run, controller file, or wall-follower.
        calibration: file of the robot's calibration; None for the nominal robot.
        seconds: duration of the drive [s].
        start: pose: x, y [m], yaw [rad].
        max_speed: no wheel rolls faster than this [m/s]; None if it may.
        dry_run: whether it stands still.
        calibrate: whether its sensors are zeroed first.
        log: name of the log files without their endings.
        verbose: whether messages have details.
    """

    port: str
    controller: str
    calibration: str | None
    seconds: float
    start: tuple[float, float, float]
    max_speed: float | None
    dry_run: bool
    calibrate: bool
    log: str
    verbose: bool

    def to_json(self) -> str:
        """The order as text."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Read what `to_json` gave."""
        fields = json.loads(text)
        return cls(**{**fields, "start": tuple(fields["start"])})


@dataclass(frozen=True)
class Champion:
    """A policy that can drive a robot.

    Attributes:
        policy: itself.
        task: what it was evolved for.
        robot: that it was evolved on.
        arena: that it was evolved in.
    """

    policy: Policy
    task: TaskParameters
    robot: str
    arena: str


def champion(name: str) -> Champion:
    """The champion of a run's directory, of a controller file, or `wall-follower`.

    Raises:
        UserError: if there is none.
    """
    if name == YARDSTICK:
        return Champion(WallFollower(), TaskParameters(), "epuck", "arena")
    file = load_controller(name)
    return Champion(file.controller, file.task, file.origin.robot, file.origin.arena)


def mission(order: Order) -> Mission:
    """The mission that an order means.

    Raises:
        UserError: if a file of it is missing or damaged.
    """
    driver = champion(order.controller)
    calibration = order.calibration
    return Mission(
        policy=driver.policy,
        task=driver.task,
        calibration=Calibration.load(Path(calibration))
        if calibration
        else Calibration(),
        n_steps=max(1, round(order.seconds / driver.task.control_step)),
        start=order.start,
        speed_max=order.max_speed or float("inf"),
        dry_run=order.dry_run,
        calibrate=order.calibrate,
        log=Path(order.log),
        verbose=order.verbose,
    )
