"""Interface of every rung: robots that can be placed, driven and observed."""

from typing import Protocol

import numpy as np

from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.network import Controller
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.control import Robots, Trials
from epuck_mj.step.disturbances import Disturbances


class Simulator(Robots, Protocol):
    """Up to `capacity` robots of one scene, as `rungs.table.robots_in` makes them."""

    capacity: int

    def embody(self, bodies: Bodies, which: np.ndarray | None = None) -> None:
        """Give the robots bodies of their own, from their next reset or restart on.

        Their wheels may turn faster than a firmware would ask for: larger ones do.

        Args:
            bodies: of the robots, `(robots,)`.
            which: numbers of the robots, `(robots,)`; None for the first of all.
        """
        ...

    def disembody(self) -> None:
        """Give the robots the scene's body back, from the next reset on."""
        ...


class CompiledTrials(Protocol):
    """Whole trials in compiled code, as `rungs.table.compiled_trials` makes them."""

    def __call__(
        self,
        controller: Controller | WithChanges,
        starts: np.ndarray,
        disturbances: Disturbances | None,
        per_individual: int,
        to_beat: np.ndarray,
    ) -> Trials:
        """Trials `(n,)`.

        Args:
            controller: one per trial.
            starts: poses `(n, 3)`: x, y [m], yaw [rad].
            disturbances: of the trials; None for ideal robots.
            per_individual: trials of each individual, which follow one another.
            to_beat: sum of its fitness below which an individual may be broken off,
                `(n / per_individual,)`; -inf where it may not.
        """
        ...

    def explored(
        self,
        controller: Controller,
        starts: np.ndarray,
        disturbances: Disturbances | None,
        tried: np.ndarray,
    ) -> tuple[Trials, np.ndarray, np.ndarray]:
        """Trials `(n,)` of learners, what they observed and what each step earned.

        Args:
            controller: one per trial.
            starts: poses `(n, 3)`: x, y [m], yaw [rad].
            disturbances: of the trials; None for ideal robots.
            tried: see `Exploring`, `(n, steps, 2)`.

        Returns:
            The trials, observations `(n, steps, 8)` at the beginning of each control
            step, and step fitness `(n, steps)`; both are 0 after a trial's end.
        """
        ...
