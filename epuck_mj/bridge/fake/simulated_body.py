"""The emulated e-puck's body: a simulated robot.

Time is divided into physics steps. A command takes effect in the next step, and a
sensor reading is that of the last step. Both are recorded, so that a simulation can be
given the same times. When a standing robot is told to drive, its physics steps are
shifted to end `LEAD` after that moment. Then a command of a host with a steady pace
that comes a millisecond early or late still falls into the same physics step.
"""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from epuck_mj.bridge.fake.motors_and_sensors import Wheel
from epuck_mj.constants import N_PROXIMITY, PROXIMITY_COUNT_MAX
from epuck_mj.host.files import write_arrays, writing
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import proximity

LEAD = 0.0045
"""Delay with which later commands still meet their physics step [s]. Chosen.

Readings, asked for some 4 ms before commands, then see samples of 16 ms all in the same
physics step if that is one of 25 ms.
"""

DARK = 3900
"""Counts of ambient light in a room: chosen, nothing depends on it."""


@dataclass
class Journal:
    """Record of a body; each row of `pose` is the end of a physics step.

    Attributes:
        pose: `(steps + 1)` of `(3,)`: x, y [m], yaw [rad].
        contact: whether its shell touched a wall, `(steps + 1)`.
        command_step: physics steps made when each command came.
        command: rate [steps/s] and pause [s] of the left, then of the right wheel.
        sample_step: physics steps made when the sensors were read.
        sample: counts read, `(8,)` each.
        told: number of the sample that was told, each time the host asked.
    """

    pose: list[np.ndarray] = field(default_factory=list)
    contact: list[bool] = field(default_factory=list)
    command_step: list[int] = field(default_factory=list)
    command: list[tuple[float, float, float, float]] = field(default_factory=list)
    sample_step: list[int] = field(default_factory=list)
    sample: list[np.ndarray] = field(default_factory=list)
    told: list[int] = field(default_factory=list)

    def save(self, path: Path, timestep: float) -> None:
        """Write the journal as .npz, with the physics step [s].

        Raises:
            UserError: if that is not possible.
        """
        arrays = {name: np.array(rows) for name, rows in vars(self).items()}
        with writing():
            write_arrays(path, {"timestep": np.array(timestep), **arrays})


class SimulatedBody:
    """A robot in its scene: see `motors_and_sensors.Body`.

    Attributes:
        journal: what it did.
        wheels: what the motors do now, left and right.
        volts: of its battery [V].
    """

    def __init__(self, scene: Scene, start: np.ndarray, now: float) -> None:
        """Place the robot at rest.

        Args:
            scene: robot and arena.
            start: pose `(3,)`: x, y [m], yaw [rad].
            now: the time [s].
        """
        # its control steps are physics steps
        self._robots = robots_in(replace(scene, n_substeps=1), 1, 1)
        self._reading = self._robots.reset(start[None])
        self._timestep = scene.model.opt.timestep
        self._origin = self._now = now
        self._n_steps = 0
        self._turned = np.zeros(2)
        self._pauses = np.zeros(2)
        self.wheels = (Wheel(0.0, 0.0), Wheel(0.0, 0.0))
        self.journal = Journal()
        self.volts = 3.7
        self._note()

    @property
    def pose(self) -> np.ndarray:
        """True pose, `(3,)`: x, y [m], yaw [rad]."""
        return self.journal.pose[-1]

    @property
    def standing(self) -> bool:
        """Whether the motors are commanded to stand still."""
        return not any(wheel.rate for wheel in self.wheels)

    def advance(self, now: float) -> None:
        """Simulate up to the time `now` [s], never less than before."""
        self._now = now
        while self._origin + (self._n_steps + 1) * self._timestep <= now:
            self._step()

    def drive(self, left: Wheel, right: Wheel) -> None:
        """See Body."""
        if self.standing:
            end = self._now + min(LEAD, self._timestep)
            self._origin = end - (self._n_steps + 1) * self._timestep
        self.wheels = (left, right)
        self._pauses[:] = left.pause, right.pause
        self.journal.command_step.append(self._n_steps)
        self.journal.command.append((left.rate, left.pause, right.rate, right.pause))

    def steps(self) -> tuple[int, int]:
        """See Body."""
        left, right = self._turned
        # a step is made when the motor has gone all its way
        return math.floor(left + 1e-9), math.floor(right + 1e-9)

    def proximity(self) -> np.ndarray:
        """See Body."""
        counts = np.rint(proximity(self._reading.distance[0])).astype(int)
        counts = np.minimum(counts, PROXIMITY_COUNT_MAX)
        self.journal.sample_step.append(self._n_steps)
        self.journal.sample.append(counts)
        return counts

    def told(self, times: int) -> None:
        """Record how often the latest sample was sent to the host."""
        self.journal.told += [len(self.journal.sample) - 1] * times

    def ambient(self) -> np.ndarray:
        """See Body."""
        return np.full(N_PROXIMITY, DARK)

    def selector(self) -> int:
        """See Body: where an e-puck v1 obeys the bridge."""
        return 3

    def battery(self) -> float:
        """See Body."""
        return self.volts

    def _step(self) -> None:
        held = np.minimum(self._pauses, self._timestep)
        self._pauses -= held
        rates = np.array([wheel.rate for wheel in self.wheels])
        # a wheel that waits for part of the step is slower in all of it
        turned = rates * (self._timestep - held)
        self._turned += turned
        speeds = turned / self._timestep * STEP_ANGLE
        self._reading = self._robots.step(speeds[None])
        self._n_steps += 1
        self._note()

    def _note(self) -> None:
        self.journal.pose.append(self._robots.poses()[0])
        self.journal.contact.append(bool(self._reading.contact[0]))
