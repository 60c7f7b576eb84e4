"""Many kinematic robots, each in its own copy of the arena."""

from functools import cached_property

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.rungs.kinematic.kernel import (
    COS,
    LEFT_AHEAD,
    LEFT_AROUND,
    N_OWN,
    N_STATE,
    OUTWARD,
    RADIUS,
    SIN,
    TIME_AHEAD,
    TIME_AROUND,
    YAW,
    X,
    room_for_rays,
    sense_all,
    step_all,
    touch_all,
)
from epuck_mj.rungs.kinematic.plan import SUBSTEP, Plan, plan_of
from epuck_mj.scene.clearance import ClearanceProbe, beside_wider
from epuck_mj.scene.model import Scene
from epuck_mj.step.bodies import SPARE_SPEED, Bodies
from epuck_mj.step.elementary import cos_sin, exp
from epuck_mj.step.sensors import Reading

ENDLESS = 1e6
"""Reach of rays that see all there is [m]."""

ROOM = 0.005
"""Multiple of which plans have room for wider bodies [m]: few plans for all robots."""


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
        self._rays = room_for_rays(self._plan)
        self._bodies, self._room = Bodies.own(capacity), 0.0
        self._spare = 1.0
        self._states = np.zeros((0, N_STATE))
        self._numbers = np.zeros((0, N_OWN))

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
        bodies = self._bodies[: len(starts)]
        self._numbers = own_numbers(self._plan, bodies, self._time)
        return self._read(self._states, self._numbers)

    def step(self, command: np.ndarray) -> Reading:
        """Drive the active robots for one control step.

        A robot whose shell touches a wall stops there.

        Args:
            command: wheel speeds [rad/s], `(active, 2)`.
        """
        most = self._plan.body.speed_max * self._spare
        distance = np.empty((len(self._states), N_PROXIMITY))
        contact = np.empty(len(self._states), bool)
        step_all(
            self._plan,
            self._rays,
            self._states,
            self._numbers,
            np.clip(command, -most, most),
            substeps(self._time),
            ENDLESS,
            distance,
            contact,
        )
        return Reading(distance, contact)

    def restart(self, which: np.ndarray, starts: np.ndarray) -> Reading:
        """See `Robots.restart`."""
        states = at_rest(starts)
        self._states[which] = states
        own = own_numbers(self._plan, self._bodies[which], self._time)
        self._numbers[which] = own
        return self._read(states, own)

    def keep(self, mask: np.ndarray) -> None:
        """Keep only the active robots that `mask` `(active,)` selects."""
        self._states, self._numbers = self._states[mask], self._numbers[mask]

    def poses(self) -> np.ndarray:
        """Poses of the active robots, `(active, 3)`: x, y [m], yaw [rad]."""
        poses = self._states[:, [X, X + 1, YAW]]
        poses[:, 2] -= 2 * np.pi * np.rint(poses[:, 2] / (2 * np.pi))
        return poses

    def clearances(self) -> np.ndarray:
        """Distances from the active robots to the nearest wall [m], `(active,)`."""
        wider = self._numbers[:, RADIUS] - self._plan.body.shell
        return beside_wider(self._probe.measure(self.poses()).distance, wider)

    def embody(self, bodies: Bodies, which: np.ndarray | None = None) -> None:
        """See `Simulator.embody`; wheels that roll have no friction to lose."""
        self._bodies.put(slice(len(bodies)) if which is None else which, bodies)
        self._spare = SPARE_SPEED
        if (room := room_for(bodies)) > self._room:
            self._plan = plan_of(self.scene, ENDLESS, self._time, room)
            self._room = room

    def disembody(self) -> None:
        """See `Simulator.disembody`."""
        self._bodies, self._spare = Bodies.own(self.capacity), 1.0

    def _read(self, states: np.ndarray, own: np.ndarray) -> Reading:
        """Reading of robots where they stand."""
        contact = np.empty(len(states), bool)
        touch_all(self._plan, states, own, contact)
        return Reading(sensed(self._plan, states, own, ENDLESS), contact)

    @cached_property
    def _probe(self) -> ClearanceProbe:
        """Clearance probe, made at its first use."""
        return ClearanceProbe(self.scene, self._threads)


def sensed(plan: Plan, states: np.ndarray, own: np.ndarray, reach: float) -> np.ndarray:
    """Distances that robots sense where they stand [m], `(n, 8)`; -1 if nothing.

    Args:
        plan: robot and arena.
        states: of the robots, `(n, N_STATE)`.
        own: numbers of their bodies, `(n, N_OWN)`; only OUTWARD counts.
        reach: farthest that rays have to see [m].
    """
    distance = np.empty((len(states), N_PROXIMITY))
    sense_all(plan, room_for_rays(plan), states, own, reach, distance)
    return distance


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


def room_for(bodies: Bodies) -> float:
    """Room that a plan needs for the widest of some bodies [m]."""
    widest = max(bodies.wider.max(initial=0), bodies.outward.max(initial=0))
    return ROOM * float(np.ceil(widest / ROOM))


def own_numbers(plan: Plan, bodies: Bodies, control_step: float) -> np.ndarray:
    """What the kernel needs to know of the bodies of robots, `(n, N_OWN)`.

    Of the speeds ahead and around, the share of the difference to the command that is
    left after a substep, and its time [s] that counts for the way in it; the radius of
    the shell and how far outward the sensors are [m].

    Args:
        plan: of a robot that bodies differ from.
        bodies: of the robots, `(n,)`.
        control_step: its duration [s].
    """
    _, substep = substeps(control_step)
    time = plan.massless + bodies.mass[:, None] * (plan.lag - plan.massless)
    time = bodies.lag[:, None] * time
    left = exp(-substep / time)
    own = np.empty((len(bodies), N_OWN))
    own[:, [LEFT_AHEAD, LEFT_AROUND]] = left
    own[:, [TIME_AHEAD, TIME_AROUND]] = (1.0 - left) * time
    own[:, RADIUS] = plan.body.shell + bodies.wider
    own[:, OUTWARD] = bodies.outward
    return own
