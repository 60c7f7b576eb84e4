"""The control loop of a real robot, and the trajectory it records.

The step is `control.control_step`, the one of every simulation.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from epuck_mj.bridge.drive.robot import Moment, RealRobot
from epuck_mj.step.control import (
    ControlStep,
    Policy,
    TaskParameters,
    control_step,
    started,
)
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import Reading, observe
from epuck_mj.trials.trajectory import Trajectory, hidden_outputs


@dataclass(frozen=True)
class Step:
    """A control step of a real robot.

    Attributes:
        number: 1 for the first.
        control: decided, carried out and judged.
        moment: what the robot reported at its end.
        compute: time that our own work took, all waiting left out [s].
    """

    number: int
    control: ControlStep
    moment: Moment
    compute: float


@dataclass
class Session:
    """Record of a drive, complete or interrupted.

    Attributes:
        task: what the robot is at.
        start: its first moment; None if nothing was read.
        reading: its first reading; None if there was none.
        steps: so far.
    """

    task: TaskParameters
    start: Moment | None = None
    reading: Reading | None = None
    steps: list[Step] = field(default_factory=list)

    def drive(
        self, robot: RealRobot, policy: Policy, n_steps: int, clock: Callable[[], float]
    ) -> Iterator[Step]:
        """Yield control steps as they happen; does not stop the robot.

        Args:
            robot: to drive; the caller stops it.
            policy: called with observations `(8,)`, gives actions `(2,)`.
            n_steps: how many there are at most.
            clock: the robot's.

        Raises:
            BridgeError: as the robot does.
        """
        self.reading = robot.begin()
        self.start = robot.last
        observation = observe(self.reading.distance, self.task.sensor_range)
        policy = started(policy, None)
        for number in range(1, n_steps + 1):
            began, waited = clock(), robot.waited
            control = control_step(robot, policy, observation, self.task, number - 1)
            observation = control.observation
            compute = clock() - began - (robot.waited - waited)
            step = Step(number, control, robot.last, compute)
            self.steps.append(step)
            yield step

    def trajectory(self, policy: Policy) -> Trajectory | None:
        """Trajectory of the drive, as of a simulated one; None if nothing was read.

        The pose is odometry; contacts are unknown; commands are those sent.
        """
        if self.start is None or self.reading is None:
            return None
        moments = [self.start, *(step.moment for step in self.steps)]
        readings = [self.reading, *(step.control.reading for step in self.steps)]
        distance = np.array([reading.distance for reading in readings])
        seen = observe(distance, self.task.sensor_range)
        n_steps = len(self.steps)
        controls = [step.control for step in self.steps]
        return Trajectory(
            time=np.array([moment.time for moment in moments]) - self.start.time,
            pose=np.array([moment.pose for moment in moments]),
            distance=distance,
            proximity=np.array([moment.proximity for moment in moments]),
            observation=seen,
            contact=np.zeros(n_steps + 1, bool),
            hidden=hidden_outputs(policy, seen[:-1]),
            action=_rows([control.action for control in controls]),
            command=_rows([step.moment.rates * STEP_ANGLE for step in self.steps]),
            fitness=np.array([control.fitness for control in controls], float),
            motor_steps=np.array([moment.steps for moment in moments], float),
        )


def _rows(pairs: list[np.ndarray]) -> np.ndarray:
    """Array `(n, 2)` of pairs, which may be none."""
    return np.array(pairs, float).reshape(-1, 2)
