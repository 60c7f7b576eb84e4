"""Where things are logged: the names that recordings of all trials share."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from epuck_mj.show.colors import TRIALS
from epuck_mj.trials.trajectory import Trajectory

APPLICATION = "epuck_mj"
ARENA = "arena"
TIMELINE = "sim_time"

SENSED, DECIDED, EARNED = slice(None), slice(None, -1), slice(1, None)
"""Rows of a trajectory at which there is what is sensed, decided and earned."""


@dataclass(frozen=True)
class Entities:
    """Of one trial.

    Attributes:
        name: what a person calls the trial.
        root: what everything of the trial is under.
        color: that tells it from others.
        alone: whether there are no others.
    """

    name: str
    root: str
    color: tuple[int, int, int]
    alone: bool

    @property
    def path(self) -> str:
        """Where the robot has been."""
        return f"{self.root}/path"

    @property
    def rays(self) -> str:
        """What its proximity sensors look along."""
        return f"{self.root}/rays"

    @property
    def crash(self) -> str:
        """Where it crashed."""
        return f"{self.root}/crash"

    @property
    def phase(self) -> str:
        """What it is about."""
        return f"{self.root}/phase"

    def signal(self, name: str) -> str:
        """What has no place in space."""
        return f"{self.root}/signals/{name}"

    def body(self, name: str) -> str:
        """A part that moves."""
        return f"{self.root}/robot/{name}"


def entities(names: Sequence[str]) -> list[Entities]:
    """A place for each trial; equal names are kept apart."""
    roots: list[str] = []
    for name in names:
        # a name of signs only still needs a place
        word = re.sub("[^A-Za-z0-9]+", "_", name).strip("_") or "trial"
        root = f"trials/{word}"
        again = sum(other.split("-")[0] == root for other in roots)
        roots.append(f"{root}-{again + 1}" if again else root)
    return [
        Entities(name, root, TRIALS[i % len(TRIALS)], len(names) == 1)
        for i, (name, root) in enumerate(zip(names, roots, strict=True))
    ]


def columns(trajectory: Trajectory, rows: slice | np.ndarray) -> list[rr.TimeColumn]:
    """Both timelines at those rows of what is sensed."""
    # rerun truncates seconds given as floats
    time = np.round(trajectory.time[rows] * 1e9).astype("timedelta64[ns]")
    step = np.arange(len(trajectory.time))[rows]
    return [
        rr.TimeColumn(TIMELINE, duration=time),
        rr.TimeColumn("step", sequence=step),
    ]
