"""Drives and readings of a robot for its calibration, as safe as the bridge's.

Each drive opens the connection, makes sure that the robot stands, drives, stops the
robot in any case, and closes the connection. While a person is at the robot, no program
is connected to it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.failures import BridgeError, StillMoving, told
from epuck_mj.bridge.line.interfaces import Connection
from epuck_mj.errors import UserError
from epuck_mj.host.interruption import Interruption
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.motors import STEP_ANGLE

T = TypeVar("T")

PERIOD = 0.02
"""Time between two readings [s], if the link is fast enough.

A little more than PROXIMITY_PERIOD: more readings would tell the same again.
"""

RATE = 300
"""Speed of the wheels in drives without sensor readings [steps/s]."""

N_STEPS = 4000
"""Steps of the straight drive: 0.52 m, of which 1 mm is 0.2 %."""

N_TURNS = 3
"""Turns on the spot, of which one degree is 0.1 %."""

SPACING = math.radians(1)
"""Turn between two readings of the sensors [rad]."""

MORE_THAN_A_TURN = 1.1
"""Turns while the sensors are read, as far as the track is known."""

N_LOOKS = 10
"""Number of readings that measure the link's pace."""

N_REST = 5
"""Number of readings after which a stopped robot's counters are at rest."""

SPARE_TIME = 5.0
"""Time beyond twice its own after which a drive has failed [s]. Chosen."""


class TooFewSteps(BridgeError):
    """The motors made fewer steps than they were told to."""

    happened = "the motors turned too slowly, or not at all"
    advice = "Charge its battery, and see whether something holds its wheels."


@dataclass(frozen=True)
class Bench:
    """Connection settings of the robot to calibrate.

    Attributes:
        connect: opens the way to it.
        interruption: what ends a drive before its time.
        clock: what the connection tells times by [s].
        sleep: waits for a number of seconds.
        verbose: whether messages have details.
    """

    connect: Callable[[], Connection]
    interruption: Interruption
    clock: Callable[[], float]
    sleep: Callable[[float], None]
    verbose: bool = False

    def with_robot(self, calibration: Calibration, job: Callable[[RealRobot], T]) -> T:
        """Connect, do a job, and stop the robot; the job's result.

        Args:
            calibration: what is known of the robot.
            job: called with the robot, which has greeted.

        Raises:
            UserError: if there is no robot.
            BridgeError: if it does not do what it is told.
            Interrupted: by a signal.
        """
        with self.interruption.raising():
            connection = self.connect()
        robot = RealRobot(
            connection, calibration, PERIOD, clock=self.clock, sleep=self.sleep
        )
        # however the inner block ends, the outer one stops the robot
        with robot, self.interruption.raising():
            try:
                robot.greet()
            except StillMoving:
                raise
            except BridgeError as error:
                raise UserError(told(error, self.verbose)) from None
            return job(robot)


def zero(bench: Bench, calibration: Calibration) -> None:
    """Set the sensors' zero to what they see now."""
    bench.with_robot(calibration, RealRobot.calibrate)


def drive_straight(bench: Bench, calibration: Calibration) -> float:
    """Drive straight on for about N_STEPS; the steps that the motors made."""

    def job(robot: RealRobot) -> float:
        robot.begin()
        _drive(robot, (RATE, RATE), lambda: _rolled(robot, calibration), N_STEPS)
        return _rolled(robot, calibration)

    return bench.with_robot(calibration, job)


def turn_on_the_spot(bench: Bench, calibration: Calibration) -> float:
    """Turn left for about N_TURNS; the steps that each motor made."""

    def job(robot: RealRobot) -> float:
        robot.begin()
        steps = N_TURNS * steps_per_turn(calibration)
        _drive(robot, (-RATE, RATE), lambda: _turned(robot, calibration), steps)
        return _turned(robot, calibration)

    return bench.with_robot(calibration, job)


def look_around(
    bench: Bench, calibration: Calibration
) -> tuple[np.ndarray, np.ndarray]:
    """Turn left, slowly, by more than a full turn.

    Returns:
        Yaw at each reading, not wrapped [rad], `(n,)`; counts then, `(n, 8)`.
    """

    def job(robot: RealRobot) -> tuple[np.ndarray, np.ndarray]:
        # the slower the link, the slower the turn
        robot.begin()
        times = [robot.last.time]
        for _ in range(N_LOOKS):
            robot.step(np.zeros(2))
            times.append(robot.last.time)
        period = float(np.median(np.diff(times)))
        per_turn = steps_per_turn(calibration)
        rate = max(1, round(SPACING / period * per_turn / (2 * math.pi)))
        yaws, counts = [], []

        def made() -> float:
            yaws.append(robot.last.pose[2])
            counts.append(robot.last.proximity)
            return _turned(robot, calibration)

        _drive(robot, (-rate, rate), made, MORE_THAN_A_TURN * per_turn)
        return np.array(yaws), np.array(counts)

    return bench.with_robot(calibration, job)


def steps_per_turn(calibration: Calibration) -> float:
    """Steps of each motor in a turn on the spot, one forward, one backward."""
    return math.pi * calibration.track / (calibration.wheel_radius * STEP_ANGLE)


def _rolled(robot: RealRobot, calibration: Calibration) -> float:
    """Steps, in the mean of both motors, that odometry's length is made of."""
    return float(robot.odometry.length) / (STEP_ANGLE * calibration.wheel_radius)


def _turned(robot: RealRobot, calibration: Calibration) -> float:
    """Steps of each motor that odometry's yaw is made of."""
    return float(robot.odometry.pose[2]) / (2 * math.pi) * steps_per_turn(calibration)


def _drive(
    robot: RealRobot, rates: tuple[int, int], made: Callable[[], float], steps: float
) -> None:
    """Drive until the motors have made a number of steps, then stand.

    Args:
        robot: that has begun.
        rates: of the wheels [steps/s].
        made: asked at each reading for the steps so far.
        steps: how many are wanted.

    Raises:
        BridgeError: if the motors do not make them in time.
    """
    command = np.array(rates) * STEP_ANGLE
    patience = 2 * steps / max(rates) + SPARE_TIME
    deadline = robot.last.time + patience
    while (so_far := made()) < steps:
        if robot.last.time > deadline:
            raise TooFewSteps(f"{steps:.0f} steps in {patience:.0f} s", f"{so_far:.0f}")
        robot.step(command)
    for _ in range(N_REST):
        robot.step(np.zeros(2))
