"""Names under which recordings log things."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from epuck_mj.scene.robot_parts import PREFIX
from epuck_mj.show.colors import TRIALS
from epuck_mj.trials.trajectory import Trajectory

APPLICATION = "epuck_mj"
ARENA = "arena"
TIMELINE = "sim_time"

SENSED, DECIDED, EARNED = slice(None), slice(None, -1), slice(1, None)
"""Rows of a trajectory with sensed, decided and earned values."""


@dataclass(frozen=True)
class Entities:
    """Names of the entities of one trial.

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
        """Name of the robot's path."""
        return f"{self.root}/path"

    @property
    def rays(self) -> str:
        """Name of the proximity sensors' rays."""
        return f"{self.root}/rays"

    @property
    def crash(self) -> str:
        """Name of the mark of a crash."""
        return f"{self.root}/crash"

    @property
    def phase(self) -> str:
        """Name of the robot's phase."""
        return f"{self.root}/phase"

    def signal(self, name: str) -> str:
        """Name of a plotted signal."""
        return f"{self.root}/signals/{name}"

    def body(self, name: str) -> str:
        """Name of a moving body: of the robot's, or of a thing in the arena."""
        own = name.removeprefix(PREFIX)
        return f"{self.root}/{'robot' if own != name else 'things'}/{own}"


def entities(names: Sequence[str]) -> list[Entities]:
    """Entities of each trial, numbered where trials have equal names."""
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
    """Columns of both timelines for these rows."""
    # rerun truncates seconds given as floats
    time = np.round(trajectory.time[rows] * 1e9).astype("timedelta64[ns]")
    step = np.arange(len(trajectory.time))[rows]
    return [
        rr.TimeColumn(TIMELINE, duration=time),
        rr.TimeColumn("step", sequence=step),
    ]
