"""One robot in MuJoCo that others can look at after every physics step."""

from collections.abc import Callable

import mujoco
import numpy as np

from epuck_mj.scene.model import Scene
from epuck_mj.step.sensors import Reading


class WatchedRobot:
    """One robot in an `MjData` that others can look at after every physics step.

    It starts and moves as `epuck_mj.rungs.mujoco_batch.SimulatedRobots` does.

    Attributes:
        scene: robot and arena.
        data: what others can look at.
        moved: called when the robot was reset and after every physics step.
    """

    def __init__(self, scene: Scene):
        """Allocate the robot."""
        self.scene = scene
        self.data = mujoco.MjData(scene.model)
        self.moved: Callable[[], None] = lambda: None

    def reset(self, start: np.ndarray) -> Reading:
        """Put the robot at rest on a start `(3,)`: x, y [m], yaw [rad]."""
        model, data = self.scene.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[:] = self.scene.qpos(start)
        mujoco.mj_step1(model, data)
        self.moved()
        return self._reading()

    def step(self, command: np.ndarray) -> Reading:
        """Drive for one control step.

        Args:
            command: wheel speeds [rad/s], `(1, 2)`.
        """
        model, data = self.scene.model, self.data
        data.ctrl[self.scene.wheels] = command[0]
        for _ in range(self.scene.n_substeps):
            # the second half first: positions and sensors are always those of now
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)
            self.moved()
        return self._reading()

    def _reading(self) -> Reading:
        return self.scene.reading(self.data.sensordata[None].copy())
