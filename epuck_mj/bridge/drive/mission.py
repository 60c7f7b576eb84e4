"""One drive of a real robot, from the greeting to the arrays of its log."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from epuck_mj.bridge.drive.log import save_arrays
from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Session, Step
from epuck_mj.bridge.failures import (
    DONE,
    FAILED,
    RUNAWAY,
    STOPPED,
    BridgeError,
    StillMoving,
    told,
    told_of_runaway,
)
from epuck_mj.bridge.line.interfaces import Connection, Greeting
from epuck_mj.errors import UserError
from epuck_mj.host.interruption import Interrupted, Interruption
from epuck_mj.host.output import OUTPUT_LOST, OutputLost
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import Policy, TaskParameters
from epuck_mj.trials.trajectory import Trajectory


@dataclass(frozen=True)
class Mission:
    """Settings of one drive of a robot.

    Attributes:
        policy: that drives it.
        task: control step, speeds, fitness.
        calibration: how the robot differs from the nominal one.
        n_steps: control steps.
        start: pose: x, y [m], yaw [rad].
        speed_max: no wheel rolls faster than this [m/s].
        dry_run: whether it stands still.
        calibrate: whether its sensors are zeroed first.
        log: name of the log files without their endings.
        verbose: whether messages have details.
    """

    policy: Policy
    task: TaskParameters
    calibration: Calibration
    n_steps: int
    start: tuple[float, float, float]
    speed_max: float
    dry_run: bool
    calibrate: bool
    log: Path
    verbose: bool


class Watcher(Protocol):
    """Observer of a drive, which can end it."""

    def say(self, text: str) -> None:
        """Receive a text to show."""
        ...

    def met(self, greeting: Greeting, robot: RealRobot) -> None:
        """Receive the news that the robot answered; it drives when this returns."""
        ...

    def saw(self, step: Step, robot: RealRobot) -> bool:
        """Receive a control step; return whether the drive has to end."""
        ...


@dataclass(frozen=True)
class Outcome:
    """How a drive ended.

    Attributes:
        status: exit status of the process.
        word: why it ended, on one line.
        session: what happened until then.
        robot: that was driven; None if there was none.
        trajectory: that was logged; None if nothing was read.
        failure: why there is no log.
    """

    status: int
    word: str
    session: Session
    robot: RealRobot | None
    trajectory: Trajectory | None
    failure: UserError | None


def accomplish(
    mission: Mission,
    connect: Callable[[], Connection],
    watcher: Watcher,
    interruption: Interruption,
) -> Outcome:
    """Drive, stop, write the arrays of the log, and return how the drive ended.

    Args:
        mission: what to do.
        connect: opens the way to the robot.
        watcher: of the drive.
        interruption: what ends it before its time.

    Raises:
        UserError: if it never began.
    """
    session = Session(mission.task)
    robot, status, word = None, DONE, ""
    trajectory = failure = None
    try:
        with interruption.raising():
            connection = connect()
        robot = RealRobot(
            connection,
            mission.calibration,
            mission.task.control_step,
            mission.speed_max,
            mission.dry_run,
            mission.start,
        )
        # however the inner block ends, the outer one stops the robot
        with robot, interruption.raising():
            word = _drive(mission, robot, session, watcher, interruption)
    except Interrupted:
        word = "interrupted"
    except StillMoving as error:
        status = RUNAWAY
        word = f"error: {told_of_runaway(error, mission.verbose)}"
    except BridgeError as error:
        if session.start is None:
            raise UserError(told(error, mission.verbose)) from None
        status, word = FAILED, f"error: {told(error, mission.verbose, STOPPED)}"
    except OutputLost as error:
        status, word = OUTPUT_LOST, f"error: {error}; the robot stands still"
    except UserError as error:
        # of a network or a step fitness of the user's own
        if session.start is None:
            raise
        status, word = FAILED, f"error: {error}; the robot was stopped and stands still"
    finally:
        try:
            trajectory = save_arrays(mission.log, session, mission.policy)
        except UserError as error:
            failure = error
    if interruption.signum is not None and status != RUNAWAY:
        status = interruption.status
        still = "the robot stands still" if robot and robot.met else "never began"
        word = f"{interruption.signum.name}: ended, {still}"
    return Outcome(status, word, session, robot, trajectory, failure)


def _drive(
    mission: Mission,
    robot: RealRobot,
    session: Session,
    watcher: Watcher,
    interruption: Interruption,
) -> str:
    """Drive the robot; why the drive ended as planned."""
    watcher.met(robot.greet(), robot)
    if mission.calibrate:
        watcher.say("calibration: keep 20 cm around the robot clear of everything")
        watcher.say("it takes up to 3 seconds ...")
        robot.calibrate()
        watcher.say("calibrated")
    for step in session.drive(robot, mission.policy, mission.n_steps, time.monotonic):
        stop = watcher.saw(step, robot)
        # it may have come where python cannot raise anything
        if interruption.signum is not None:
            raise Interrupted
        if stop:
            return "stopped by the operator's key; the robot stands still"
    return "ended; the robot stands still"
