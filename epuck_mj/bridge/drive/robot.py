"""A real robot with the interface `control.Robot` of simulated ones."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from epuck_mj.bridge.drive.odometry import Odometry
from epuck_mj.bridge.drive.schedule import Schedule
from epuck_mj.bridge.failures import (
    BridgeError,
    ComputerBusy,
    LinkLost,
    RobotRestarted,
    StaleReading,
    StillMoving,
)
from epuck_mj.bridge.line.interfaces import Connection, Greeting
from epuck_mj.constants import READING_AGE_MAX
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.motors import STEP_ANGLE, step_rates
from epuck_mj.step.sensors import Reading, sensed_distance

READING = f"a reading every {READING_AGE_MAX * 1000:.0f} ms"


@dataclass(frozen=True)
class Moment:
    """What a robot reported at the end of a control step, beside its reading.

    Attributes:
        time: when it came, since the robot started [s].
        proximity: counts ps0..ps7, `(8,)`.
        pose: by odometry, `(3,)`: x, y [m], yaw [rad].
        steps: that both motors have made since the start, `(2,)`.
        rates: that it was told to drive at [steps/s], left and right, `(2,)`.
        latency: from asking for the reading to having it [s].
    """

    time: float
    proximity: np.ndarray
    pose: np.ndarray
    steps: np.ndarray
    rates: np.ndarray
    latency: float


class RealRobot:
    """A robot on a connection; the end of its `with` block stops it in any case.

    A control step is two questions. As it starts, its speeds, if they changed: the echo
    in the answer shows that they arrived. As it ends, the reading. So the policy
    decides on what is sensed at that moment, as in simulation, and not on what was
    sensed a control step ago.

    Attributes:
        schedule: when control steps end.
        odometry: where it is.
        last: what it reported last.
        met: whether it ever answered.
        waited: time spent on answers and on the schedule, since it started [s].
    """

    last: Moment

    def __init__(
        self,
        connection: Connection,
        calibration: Calibration,
        control_step: float,
        speed_max: float = float("inf"),
        dry_run: bool = False,
        start: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0),
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Use a connection, without sending anything.

        Args:
            connection: how to reach it.
            calibration: how it differs from the nominal robot.
            control_step: duration of a control step [s].
            speed_max: no wheel rolls faster than this [m/s].
            dry_run: whether it has to stand still all the time.
            start: pose `(3,)`: x, y [m], yaw [rad].
            clock: returns the time [s]; the connection's clock.
            sleep: waits for a number of seconds.
        """
        self._connection = connection
        self._calibration = calibration
        self._wheel_speed_max = speed_max / max(calibration.wheel_radii)
        self._dry_run = dry_run
        self._clock = clock
        self.met = False
        self._rates = (0, 0)
        self._driven = False
        self._fresh_until = float("inf")
        self._origin = clock()
        self.schedule = Schedule(control_step, clock, sleep)
        self.odometry = Odometry(calibration, np.asarray(start, float))
        self.waited = 0.0

    @property
    def n_repairs(self) -> int:
        """How often host and robot had to synchronise again."""
        return self._connection.n_repairs

    def poses(self) -> np.ndarray:
        """See `Robot.poses`: unknown, NaN."""
        return np.full(3, np.nan)

    def clearances(self) -> np.ndarray:
        """See `Robot.clearances`: unknown, NaN."""
        return np.array(np.nan)

    def __enter__(self) -> Self:
        """The robot itself; nothing is sent yet."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop the robot, if it ever answered.

        Raises:
            StillMoving: if it was driven and does not say that it stopped.
        """
        try:
            if self.met:
                self._connection.stop()
        except StillMoving:
            # the robot stood still when it answered, and got no other command since
            if self._driven:
                raise
        finally:
            self._connection.close()

    def greet(self) -> Greeting:
        """Greet the robot and stop it; its version and battery."""
        greeting = self._connection.greet()
        self.met = True
        return greeting

    def calibrate(self) -> None:
        """Let the resting robot set its sensors' zero; nothing may be near it."""
        self._connection.calibrate()

    def rest(self) -> None:
        """Ask the robot, which stands and waits, for a reading.

        So its loss is noticed, and over WiFi no readings pile up.
        """
        self._cycle((0, 0), changed=False)
        # however long it takes until the next one
        self._fresh_until = float("inf")

    def begin(self) -> Reading:
        """Start the first control step; the first reading."""
        self._origin = self._clock()
        self.waited = 0.0
        # as at every tick: first the reading, then what comes of it
        self.schedule.begin()
        return self._sense()

    def step(self, command: np.ndarray) -> Reading:
        """Drive for one control step; the reading at its end.

        Args:
            command: wheel speeds [rad/s], `(2,)`.

        Raises:
            StaleReading: if there was no reading for READING_AGE_MAX.
            RobotRestarted: if it was reset.
            LinkLost: if the port was lost.
        """
        rates = (0, 0) if self._dry_run else self.told(command)
        if rates != self._rates:
            # unknown until the robot has answered
            self._cycle(rates, changed=True)
            self._rates = rates
        before = self._clock()
        self.schedule.wait()
        self.waited += self._clock() - before
        return self._sense()

    def told(self, command: np.ndarray) -> tuple[int, int]:
        """Whole steps/s for wheel speeds `(2,)` [rad/s], slowed alike if too fast."""
        fastest = float(np.abs(command).max())
        slowed = command * min(1.0, self._wheel_speed_max / max(fastest, STEP_ANGLE))
        left, right = step_rates(slowed).tolist()
        return left, right

    def _sense(self) -> Reading:
        asked = self._clock()
        counts = self._cycle(self._rates, changed=False)
        now = self._clock()
        self.last = Moment(
            time=now - self._origin,
            proximity=counts,
            pose=self.odometry.pose,
            steps=self.odometry.steps,
            rates=np.array(self._rates),
            latency=now - asked,
        )
        distance = sensed_distance(counts, self._calibration.gains)
        return Reading(distance, np.zeros((), bool), counts)

    def _cycle(self, rates: tuple[int, int], changed: bool) -> np.ndarray:
        """Current counts `(8,)`; updates time and odometry."""
        asked = self._clock()
        if asked > self._fresh_until:
            age = asked - self._fresh_until + READING_AGE_MAX
            raise ComputerBusy(READING, f"none for {age * 1000:.0f} ms")
        until = min(self._fresh_until, asked + READING_AGE_MAX)
        self._driven |= any(rates)
        try:
            cycle = self._connection.cycle(*rates, changed, until)
        except (LinkLost, RobotRestarted):
            raise
        except BridgeError as error:
            raise StaleReading(READING, f"none: {error}") from None
        finally:
            self.waited += self._clock() - asked
        now = self._clock()
        self._fresh_until = now + READING_AGE_MAX
        self.odometry.update(cycle.steps, asked, now)
        return np.array(cycle.proximity.counts, float)
