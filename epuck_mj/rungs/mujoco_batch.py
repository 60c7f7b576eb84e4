"""Many simulated robots, each in its own copy of the arena, stepped at once.

One `mujoco.batch.Batch` holds them; its threads step the ones still active. What a
robot does depends on its start and commands only: not on the number of threads, nor
on which others share the batch.
"""

from functools import cached_property

import mujoco
import numpy as np
from mujoco.batch import Batch

from epuck_mj.rungs.bodies import body_fields, shape_fields, wheel_limits
from epuck_mj.rungs.warnings import heeded, silence
from epuck_mj.scene.clearance import ClearanceProbe, beside_wider
from epuck_mj.scene.model import Scene
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.sensors import Reading


class MujocoRobots:
    """Up to `capacity` robots in copies of one scene."""

    def __init__(self, scene: Scene, capacity: int, threads: int = 0):
        """Allocate the robots.

        Args:
            scene: robot and arena.
            capacity: the most robots that a reset can place.
            threads: threads that step them; 0 is one per core.
        """
        silence()
        self.scene = scene
        self.capacity = capacity
        # one MjData each, so that sensors refreshed after a step are not
        # computed again at the start of the next
        self._batch = Batch(scene.sparing(), capacity, threads, persistent=True)
        self._qpos = self._batch.bind("qpos")
        self._ctrl = self._batch.bind("ctrl")
        self._sensordata = self._batch.bind("sensordata")
        self._history = self._batch.bind("history")
        self._about, self._warned = np.moveaxis(self._batch.warning, -1, 0)
        self._active = np.zeros(0, np.int32)
        self._embodied = self._shaped = False
        self._wider = np.zeros(capacity)
        self._threads = threads

    def reset(self, starts: np.ndarray) -> Reading:
        """Put a robot at rest on each start `(robots, 3)`: x, y [m], yaw [rad].

        Raises:
            ValueError: if there are more starts than robots.
        """
        if len(starts) > self.capacity:
            raise ValueError(
                f"expected at most {self.capacity} starts, got {len(starts)}"
            )
        self._active = np.arange(len(starts), dtype=np.int32)
        return self._placed(self._active, starts)

    def restart(self, which: np.ndarray, starts: np.ndarray) -> Reading:
        """See `Robots.restart`."""
        return self._placed(which.astype(np.int32), starts)

    def step(self, command: np.ndarray) -> Reading:
        """Drive the active robots for one control step.

        Args:
            command: wheel speeds [rad/s], `(active, 2)`.

        Raises:
            UserError: if MuJoCo warns of a simulation that means nothing.
        """
        self._ctrl[self._active[:, None], self.scene.wheels] = command
        with heeded(self.scene, self._warned, self._about):
            self._batch.step(
                self._active,
                nstep=self.scene.n_substeps,
                stage=mujoco.mjtStage.mjSTAGE_VEL.value,
            )
        return self._reading(self._active)

    def embody(self, bodies: Bodies, which: np.ndarray | None = None) -> None:
        """See `Simulator.embody`."""
        changes = wheel_limits(self.scene, len(bodies))
        ids = np.arange(len(bodies)) if which is None else which
        ids = ids.astype(np.int32)
        self._wider[ids] = bodies.wider
        self._shaped |= bodies.shaped
        others = self._embodied or bodies.changed
        if others:
            changes |= body_fields(self.scene, bodies)
        if self._shaped:
            changes |= shape_fields(self.scene, bodies)
        for name, (where, values) in changes.items():
            places = np.flatnonzero(where) if where.dtype == bool else where
            self._batch.expand(name)[ids[:, None], places] = values
        if others:
            self._embodied = True
            # what the contact solver has worked out from them
            self._batch.set_const(ids)

    def disembody(self) -> None:
        """See `Simulator.disembody`."""
        if self._embodied:
            self.embody(Bodies.own(self.capacity))
            self._embodied = self._shaped = False

    def keep(self, mask: np.ndarray) -> None:
        """Keep only the active robots that `mask` `(active,)` selects."""
        self._active = self._active[mask]

    def poses(self) -> np.ndarray:
        """Poses of the active robots, `(active, 3)`: x, y [m], yaw [rad]."""
        return self.scene.poses(self._qpos[self._active])

    def clearances(self) -> np.ndarray:
        """Distances from the active robots to the nearest wall [m], `(active,)`."""
        nominal = self._probe.measure(self.poses()).distance
        return beside_wider(nominal, self._wider[self._active])

    @cached_property
    def _probe(self) -> ClearanceProbe:
        """Clearance probe, made at its first use."""
        return ClearanceProbe(self.scene, self._threads)

    def _placed(self, ids: np.ndarray, starts: np.ndarray) -> Reading:
        """What robots `(k,)` sense that were put at rest on starts `(k, 3)`."""
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._qpos[ids] = self.scene.qpos(starts)
        self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_VEL.value)
        return self._reading(ids)

    def _reading(self, ids: np.ndarray) -> Reading:
        # of a single physics step, the sensor itself says all
        history = self._history[ids] if self.scene.n_substeps > 1 else None
        return self.scene.reading(self._sensordata[ids], history)
