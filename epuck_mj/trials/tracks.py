"""Tracks: paths of many robots in one trial each, as plain arrays.

Tracks hold only what metrics need; a `Trajectory` holds everything of one trial.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Tracks:
    """Trials of `(n,)` robots of at most `T` control steps; NaN after their end.

    `command[:, k]` earned `fitness[:, k]` and led to `pose[:, k + 1]`; `pose[:, 0]` is
    the start.

    Attributes:
        pose: where the robots were, `(n, T + 1, 3)`: x, y [m], yaw [rad].
        command: wheel speeds sent, left and right [rad/s], `(n, T, 2)`.
        fitness: step fitness, `(n, T)`.
        steps: control steps lived, the crash step included, `(n,)`.
        crashed: whether a crash ended the trial, `(n,)`.
    """

    pose: np.ndarray
    command: np.ndarray
    fitness: np.ndarray
    steps: np.ndarray
    crashed: np.ndarray

    def __post_init__(self) -> None:
        """Refuse arrays that do not belong together."""
        n, steps = self.fitness.shape
        expected = {
            "pose": (n, steps + 1, 3),
            "command": (n, steps, 2),
            "steps": (n,),
            "crashed": (n,),
        }
        for name, shape in expected.items():
            if (got := getattr(self, name).shape) != shape:
                raise ValueError(f"expected {name} of shape {shape}, got {got}")

    @property
    def lived(self) -> np.ndarray:
        """Which steps the robots lived, `(n, T)`."""
        return np.arange(self.fitness.shape[1]) < self.steps[:, None]

    @property
    def trial_fitness(self) -> np.ndarray:
        """Sum of the step fitness, `(n,)`, bit-identical to that of `run_trials`."""
        # in the order of the steps: numpy's sum has an order of its own
        earned = np.where(self.lived, self.fitness, 0.0)
        return np.cumsum(earned, axis=1)[:, -1]
