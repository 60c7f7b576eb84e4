"""One robot in MuJoCo, with a callback after every physics step."""

import copy
from collections.abc import Callable
from functools import cached_property

import mujoco
import numpy as np

from epuck_mj.rungs.bodies import body_fields, shape_fields, wheel_limits
from epuck_mj.rungs.warnings import heeded, silence
from epuck_mj.scene.clearance import ClearanceProbe, beside_wider
from epuck_mj.scene.model import Scene
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.sensors import Reading


class WatchedRobot:
    """A `Simulator` of one robot in an `MjData`; it moves as in a batch, to the bit.

    Attributes:
        scene: robot and arena.
        model: the scene's, or that of a robot with a body of its own.
        data: what others can look at.
        moved: called when the robot was reset and after every physics step.
    """

    capacity = 1

    def __init__(self, scene: Scene):
        """Allocate the robot."""
        silence()
        self.scene = scene
        self.model = copy.copy(scene.model)
        self.data = mujoco.MjData(self.model)
        self.moved: Callable[[], None] = lambda: None
        self._embodied, self._wider = False, np.zeros(1)

    def reset(self, starts: np.ndarray) -> Reading:
        """Put the robot at rest on a start `(1, 3)`: x, y [m], yaw [rad]."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.scene.qpos(starts)[0]
        mujoco.mj_step1(self.model, self.data)
        self.moved()
        return self._reading()

    def step(self, command: np.ndarray) -> Reading:
        """Drive for one control step at wheel speeds `(1, 2)` [rad/s]."""
        self.data.ctrl[self.scene.wheels] = command[0]
        warning = self.data.warning
        for _ in range(self.scene.n_substeps):
            # the second half first, so that positions and sensors are of the same time
            with heeded(self.scene, warning.number, warning.lastinfo):
                mujoco.mj_step2(self.model, self.data)
                mujoco.mj_step1(self.model, self.data)
            self.moved()
        return self._reading()

    def keep(self, mask: np.ndarray) -> None:
        """See `Robots.keep`: the robot stays, or none is left to step."""

    def restart(self, which: np.ndarray, starts: np.ndarray) -> Reading:
        """See `Robots.restart`: there is one robot."""
        return self.reset(starts)

    def poses(self) -> np.ndarray:
        """Pose of the robot, `(1, 3)`: x, y [m], yaw [rad]."""
        return self.scene.poses(self.data.qpos[None])

    def embody(self, bodies: Bodies, which: np.ndarray | None = None) -> None:
        """See `Simulator.embody`."""
        fields = body_fields(self.scene, bodies) | shape_fields(self.scene, bodies)
        fields |= wheel_limits(self.scene, 1)
        self._wider = bodies.wider
        for name, (where, values) in fields.items():
            getattr(self.model, name)[where] = values[0]
        mujoco.mj_setConst(self.model, self.data)
        self._embodied = True

    def disembody(self) -> None:
        """See `Simulator.disembody`."""
        if self._embodied:
            self.embody(Bodies.own(1))
            self._embodied = False

    def clearances(self) -> np.ndarray:
        """Distance from the robot's shell to the nearest wall [m], `(1,)`."""
        return beside_wider(self._probe.measure(self.poses()).distance, self._wider)

    @cached_property
    def _probe(self) -> ClearanceProbe:
        """Clearance probe, made at its first use."""
        return ClearanceProbe(self.scene, 1)

    def _reading(self) -> Reading:
        return self.scene.reading(
            self.data.sensordata[None].copy(), self.data.history[None]
        )
