"""Many kinematic robots, each in its own copy of the arena."""

from functools import cached_property

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.rungs.bodies import SPARE_SPEED
from epuck_mj.rungs.kinematic.kernel import (
    COS,
    N_STATE,
    SIN,
    YAW,
    X,
    sense_all,
    step_all,
    touch_all,
)
from epuck_mj.rungs.kinematic.plan import SUBSTEP, Plan, plan_of
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import Scene
from epuck_mj.step.elementary import cos_sin, exp
from epuck_mj.step.sensors import Reading

ENDLESS = 1e6
"""Reach of rays that see all there is [m]."""


class KinematicRobots:
    """Up to `capacity` robots of one scene; a `Simulator`."""

    def __init__(self, scene: Scene, capacity: int, threads: int = 0):
        """Read the plan of the scene.

        Args:
            scene: robot and arena.
            capacity: the most robots that a reset can place.
            threads: of the clearance probe; the robots themselves need none.

        Raises:
            UserError: if the scene has no plan.
        """
        self.scene, self.capacity = scene, capacity
        self._threads = threads
        self._time = scene.n_substeps * scene.model.opt.timestep
        self._plan = plan_of(scene, ENDLESS, self._time)
        self._mass, self._lag = np.ones((2, capacity))
        self._spare = 1.0
        self._states = np.zeros((0, N_STATE))
        self._lags = np.zeros((0, 4))

    def reset(self, starts: np.ndarray) -> Reading:
        """Put a robot at rest on each start `(robots, 3)`: x, y [m], yaw [rad].

        Raises:
            ValueError: if there are more starts than robots.
        """
        if len(starts) > self.capacity:
            raise ValueError(
                f"expected at most {self.capacity} starts, got {len(starts)}"
            )
        self._states = at_rest(starts)
        n = len(starts)
        self._lags = lags(self._plan, self._mass[:n], self._lag[:n], self._time)
        distance, contact = _empty(n)
        touch_all(self._plan, self._states, contact)
        sense_all(self._plan, self._states, ENDLESS, distance)
        return Reading(distance, contact)

    def step(self, command: np.ndarray) -> Reading:
        """Drive the active robots for one control step.

        A robot whose shell touches a wall stops there.

        Args:
            command: wheel speeds [rad/s], `(active, 2)`.
        """
        most = self._plan.body.speed_max * self._spare
        distance, contact = _empty(len(self._states))
        step_all(
            self._plan,
            self._states,
            self._lags,
            np.clip(command, -most, most),
            *substeps(self._time),
            ENDLESS,
            distance,
            contact,
        )
        return Reading(distance, contact)

    def restart(self, which: np.ndarray, starts: np.ndarray) -> Reading:
        """See `Robots.restart`."""
        states = at_rest(starts)
        self._states[which] = states
        mass, lag = self._mass[which], self._lag[which]
        self._lags[which] = lags(self._plan, mass, lag, self._time)
        distance, contact = _empty(len(states))
        touch_all(self._plan, states, contact)
        sense_all(self._plan, states, ENDLESS, distance)
        return Reading(distance, contact)

    def keep(self, mask: np.ndarray) -> None:
        """Keep only the active robots that `mask` `(active,)` selects."""
        self._states, self._lags = self._states[mask], self._lags[mask]

    def poses(self) -> np.ndarray:
        """Poses of the active robots, `(active, 3)`: x, y [m], yaw [rad]."""
        poses = self._states[:, [X, X + 1, YAW]]
        poses[:, 2] -= 2 * np.pi * np.rint(poses[:, 2] / (2 * np.pi))
        return poses

    def clearances(self) -> np.ndarray:
        """Distances from the active robots to the nearest wall [m], `(active,)`."""
        return self._probe.measure(self.poses()).distance

    def embody(
        self,
        mass: np.ndarray,
        friction: np.ndarray,
        lag: np.ndarray,
        which: np.ndarray | None = None,
    ) -> None:
        """See `Simulator.embody`; wheels that roll have no friction to lose."""
        ids = slice(len(mass)) if which is None else which
        self._mass[ids], self._lag[ids] = mass, lag
        self._spare = SPARE_SPEED

    def disembody(self) -> None:
        """See `Simulator.disembody`."""
        self._mass, self._spare = np.ones(self.capacity), 1.0
        self._lag = np.ones(self.capacity)

    @cached_property
    def _probe(self) -> ClearanceProbe:
        """Clearance probe, made at its first use."""
        return ClearanceProbe(self.scene, self._threads)


def _empty(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances and contacts of a reading of `n` robots, to be filled."""
    return np.empty((n, N_PROXIMITY)), np.empty(n, bool)


def at_rest(starts: np.ndarray) -> np.ndarray:
    """States `(n, N_STATE)` of robots that stand on starts `(n, 3)`."""
    states = np.zeros((len(starts), N_STATE))
    states[:, [X, X + 1, YAW]] = starts
    states[:, COS], states[:, SIN] = cos_sin(starts[:, 2])
    return states


def substeps(control_step: float) -> tuple[int, float]:
    """Number of substeps of a control step and the duration of one [s]."""
    n = max(1, int(np.ceil(control_step / SUBSTEP - 1e-9)))
    return n, control_step / n


def lags(
    plan: Plan, mass: np.ndarray, lag: np.ndarray, control_step: float
) -> np.ndarray:
    """What `kernel.move` needs to know of the lags of robots, `(n, 4)`.

    Args:
        plan: of a robot whose mass and lag are 1.
        mass: against that robot's, `(n,)`.
        lag: of the time constants, likewise.
        control_step: its duration [s].
    """
    _, substep = substeps(control_step)
    own = plan.massless + mass[:, None] * (plan.lag - plan.massless)
    own = lag[:, None] * own
    left = exp(-substep / own)
    return np.stack([left, (1.0 - left) * own], axis=-1).reshape(-1, 4)
