"""Trajectories: everything one robot did and sensed in one trial, as plain arrays.

The neutral record of a trial, stored as .npz; figures and recordings are views of it.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.host.files import read_arrays, write_arrays, writing
from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.network import Controller
from epuck_mj.step.control import Policy

FORMAT = "epuck_mj.trajectory/2"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One trial of one robot, `T` control steps; row 0 is the start.

    `action[k]` was decided on `observation[k]`, earned `fitness[k]` and led to row
    `k + 1` of what is sensed.

    Attributes:
        time: since the start [s], `(T + 1,)`.
        pose: where the robot was, `(T + 1, 3)`: x, y [m], yaw [rad].
        distance: along each proximity ray [m], negative where nothing was hit,
            `(T + 1, 8)`.
        proximity: counts of each proximity sensor, `(T + 1, 8)`.
        observation: what the policy saw of it, in [0, 1], `(T + 1, 8)`.
        contact: whether the shell touched a wall, `(T + 1,)`, bool.
        hidden: output of the hidden neurons in [0, 1], `(T, hidden)`; of a policy
            that has none, `(T, 0)`.
        action: what the policy decided, `(T, 2)`: v in [0, 1], w in [-1, 1].
        command: wheel speeds sent, left and right [rad/s], `(T, 2)`.
        fitness: step fitness, `(T,)`.
        motor_steps: that the motors have made since the start, left and right, by the
            counters of a real robot, `(T + 1, 2)`; None of a simulated one.
    """

    time: np.ndarray
    pose: np.ndarray
    distance: np.ndarray
    proximity: np.ndarray
    observation: np.ndarray
    contact: np.ndarray
    hidden: np.ndarray
    action: np.ndarray
    command: np.ndarray
    fitness: np.ndarray
    motor_steps: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Refuse arrays that do not belong together."""
        steps = self.fitness.size
        expected = {
            "time": (float, (steps + 1,)),
            "pose": (float, (steps + 1, 3)),
            "distance": (float, (steps + 1, N_PROXIMITY)),
            "proximity": (float, (steps + 1, N_PROXIMITY)),
            "observation": (float, (steps + 1, N_PROXIMITY)),
            "contact": (bool, (steps + 1,)),
            "hidden": (float, (steps, *self.hidden.shape[-1:])),
            "action": (float, (steps, 2)),
            "command": (float, (steps, 2)),
            "fitness": (float, (steps,)),
        }
        if self.motor_steps is not None:
            expected["motor_steps"] = (float, (steps + 1, 2))
        for name, (dtype, shape) in expected.items():
            got = getattr(self, name)
            if got.dtype != dtype or got.shape != shape:
                raise ValueError(
                    f"expected {name} of type {np.dtype(dtype)} and shape {shape}, "
                    f"got {got.dtype} {got.shape}"
                )

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """Its arrays by name, without those that it has not."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: array for name, array in arrays.items() if array is not None}

    @property
    def steps(self) -> int:
        """Control steps lived, the crash step included."""
        return self.fitness.size

    @property
    def crashed(self) -> bool:
        """Whether a crash ended the trial."""
        return bool(self.contact[-1])

    @property
    def cumulative_fitness(self) -> np.ndarray:
        """Step fitness summed up to each step, `(T,)`, in the order of the steps."""
        return np.cumsum(self.fitness)

    @property
    def trial_fitness(self) -> float:
        """Sum of the step fitness, bit-identical to that of `run_trials`."""
        return float(self.cumulative_fitness[-1]) if self.steps else 0.0

    def save(self, path: str | Path) -> None:
        """Write the trajectory as .npz; equal trajectories make equal files.

        Raises:
            UserError: if it cannot be written.
        """
        with writing():
            write_arrays(Path(path), {"format": np.array(FORMAT), **self.arrays})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Raises:
            UserError: if the file is missing, damaged or something else.
        """
        arrays = read_arrays(Path(path))
        try:
            if str(arrays.pop("format", "")) != FORMAT:
                raise ValueError(f"expected format '{FORMAT}'")
            return cls(**arrays)
        except (TypeError, ValueError) as error:
            raise UserError(f"'{path}' is not a trajectory file: {error}") from None


def hidden_outputs(policy: Policy, observations: np.ndarray) -> np.ndarray:
    """Outputs of hidden neurons, `(T, hidden)`; `(T, 0)` without a network.

    Args:
        policy: that saw the observations, one after the other.
        observations: `(T, 8)`.
    """
    if isinstance(policy, Controller | WithChanges):
        # the same bits, alone or among other robots
        return policy.activation(observations)
    return np.zeros((len(observations), 0))
