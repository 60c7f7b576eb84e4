"""Pictures of a trial that is going on."""

import atexit
from contextlib import ExitStack

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.scene.model import Scene
from epuck_mj.show.render import painter
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.trajectory import Trajectory


class TrialPicture:
    """The arena with the robot and its path so far, coloured by step fitness."""

    def __init__(self, scene: Scene, task: TaskParameters, width: int, height: int):
        """Set the picture up; OpenGL is made at the first one.

        Args:
            scene: robot and arena.
            task: what a trial is.
            width: of the pictures [pixels].
            height: of the pictures [pixels].
        """
        self._scene, self._size = scene, (width, height)
        self._open, self._painter, self._k = ExitStack(), None, 0
        self._step = task.control_step
        self._trajectory = _blank(task)

    def begin(self, pose: np.ndarray) -> None:
        """Begin a trial at a pose `(3,)`."""
        self._k = 0
        self._trajectory.pose[0] = pose

    def add(self, pose: np.ndarray, fitness: float) -> None:
        """Add a control step that led to a pose `(3,)`."""
        self._trajectory.fitness[self._k] = fitness
        self._k += 1
        self._trajectory.pose[self._k] = pose

    def pixels(self) -> np.ndarray:
        """What it looks like now, `(height, width, 3)`, 0 to 255.

        Raises:
            UserError: if no OpenGL is there.
        """
        if self._painter is None:
            artist = painter(self._scene, [self._trajectory], *self._size, draft=True)
            self._painter = self._open.enter_context(artist)
            # free OpenGL before its library ends, even without a call of close()
            atexit.register(self.close)
        return self._painter.picture(self._k * self._step).copy()

    def close(self) -> None:
        """Free OpenGL."""
        atexit.unregister(self.close)
        self._open.close()
        self._painter = None


def _blank(task: TaskParameters) -> Trajectory:
    """A trajectory of all steps of a trial, whose poses and fitness can be written.

    All else is 0 and takes no memory.
    """
    steps = task.steps
    sensed = np.broadcast_to(0.0, (steps + 1, N_PROXIMITY))
    decided = np.broadcast_to(0.0, (steps, 2))
    return Trajectory(
        time=np.arange(steps + 1) * task.control_step,
        pose=np.zeros((steps + 1, 3)),
        distance=sensed,
        proximity=sensed,
        observation=sensed,
        contact=np.broadcast_to(False, steps + 1),
        hidden=np.zeros((steps, 0)),
        action=decided,
        command=decided,
        fitness=np.zeros(steps),
    )
