"""One drive of a real robot, from the greeting to the log."""

import contextlib
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from epuck_mj.bridge.drive.console import HEADING, drive_summary, live_line
from epuck_mj.bridge.drive.keyboard import Keyboard, keyboard
from epuck_mj.bridge.drive.log import save_log
from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Session
from epuck_mj.bridge.failures import DONE, FAILED, RUNAWAY, BridgeError, StillMoving
from epuck_mj.bridge.line.interfaces import Connection
from epuck_mj.errors import UserError
from epuck_mj.host.interruption import Interrupted, Interruption
from epuck_mj.host.output import OUTPUT_LOST, Output, OutputLost, complain
from epuck_mj.scene.model import Scene
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import Policy, TaskParameters

QUIET_PERIOD = 1.0
"""Time between two status lines where output is no terminal [s]."""


@dataclass(frozen=True)
class Mission:
    """Settings of one drive of a robot.

    Attributes:
        policy: that drives it.
        task: control step, speeds, fitness.
        scene: to show the log in.
        calibration: how the robot differs from the nominal one.
        n_steps: control steps.
        start: pose: x, y [m], yaw [rad].
        speed_max: no wheel rolls faster than this [m/s].
        dry_run: whether it stands still.
        calibrate: whether its sensors are zeroed first.
        log: name of the log files without their endings.
    """

    policy: Policy
    task: TaskParameters
    scene: Scene
    calibration: Calibration
    n_steps: int
    start: tuple[float, float, float]
    speed_max: float
    dry_run: bool
    calibrate: bool
    log: Path


def accomplish(
    mission: Mission,
    connect: Callable[[], Connection],
    clock: Callable[[], float] = time.monotonic,
) -> int:
    """Drive, stop, write the log; the exit status.

    Args:
        mission: what to do.
        connect: opens the way to the robot.
        clock: what the connection tells times by.

    Raises:
        UserError: if it never began.
    """
    session = Session(mission.task)
    with (
        Output(sys.stdout) as output,
        Interruption() as interruption,
        keyboard() as keys,
    ):
        robot, status, word = None, DONE, ""
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
                clock,
            )
            # however the inner block ends, the outer one stops the robot
            with robot, interruption.raising():
                word = _drive(
                    mission, robot, session, output, keys, clock, interruption
                )
        except Interrupted:
            word = "interrupted"
        except StillMoving as error:
            status, word = RUNAWAY, _runaway(error)
        except BridgeError as error:
            if session.start is None:
                raise
            status, word = FAILED, f"error: {error}; the robot stands still"
        except OutputLost as error:
            status, word = OUTPUT_LOST, f"error: {error}; the robot stands still"
        finally:
            facts, failure = _save(mission, session, robot)
        if interruption.signum is not None and status != RUNAWAY:
            status = interruption.status
            still = "the robot stands still" if robot and robot.met else "never began"
            word = f"{interruption.signum.name}: ended, {still}"
        # stdout may be lost, so errors go to stderr first
        if status:
            complain(word)
        try:
            output.say(facts if status else f"{facts}\n{word}")
            output.finish()
        except OutputLost:
            if not status:
                raise
    if failure is not None and not status:
        raise failure
    if failure is not None:
        complain(f"error: {failure}")
    return status


def _drive(
    mission: Mission,
    robot: RealRobot,
    session: Session,
    output: Output,
    keys: Keyboard,
    clock: Callable[[], float],
    interruption: Interruption,
) -> str:
    """Drive the robot; why the drive ended as planned."""
    greeting = robot.greet()
    output.say(f"{greeting.firmware}; battery {greeting.battery}")
    if mission.calibrate:
        output.say("calibration: keep 20 cm around the robot clear of everything")
        output.say("it takes up to 3 seconds ...")
        robot.calibrate()
        output.say("calibrated")
    dry = "DRY RUN, it stands still. " if mission.dry_run else ""
    stops = "q or space stops. " if keys.there else ""
    output.say(f"{dry}{stops}Ctrl-C stops.\n{HEADING}")
    live = sys.stdout.isatty()
    every = 1 if live else max(1, round(QUIET_PERIOD / mission.task.control_step))
    try:
        for step in session.drive(robot, mission.policy, mission.n_steps, clock):
            if step.number % every == 0:
                line = live_line(step, robot)
                start, end = ("\r", "") if live else ("", "\n")
                output.say(f"{start}{line}", end)
            # it may have come where python cannot raise anything
            if interruption.signum is not None:
                raise Interrupted
            if keys.stop_wanted():
                return "stopped by the operator's key; the robot stands still"
    finally:
        if live:
            with contextlib.suppress(OutputLost):
                output.say("")
    return "ended; the robot stands still"


def _save(
    mission: Mission, session: Session, robot: RealRobot | None
) -> tuple[str, UserError | None]:
    """Write the log; the summary, and the error if the log could not be written."""
    if robot is None or session.start is None:
        return "", None
    facts = drive_summary(session, robot)
    text = f"# A real robot\n\n```\n{facts}\n```\n"
    try:
        files = save_log(mission.log, session, mission.policy, mission.scene, text)
    except UserError as error:
        return f"\n{facts}", error
    return f"\n{facts}\nlog            {', '.join(map(str, files))}", None


def _runaway(error: StillMoving) -> str:
    """Warning that the robot may still move."""
    cause = error.__context__
    before = f"; at first: {cause}" if isinstance(cause, BridgeError) else ""
    return f"error: THE MOTORS MAY STILL TURN, switch the robot off: {error}{before}"
