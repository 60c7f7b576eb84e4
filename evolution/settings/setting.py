"""Under which circumstances trials are lived: the setting, and what robots are like."""

from dataclasses import dataclass

import numpy as np

from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.disturbances import (
    BOOK,
    NOISE,
    RANGES,
    Disturbances,
    calibrated,
    draw,
)


@dataclass(frozen=True)
class Setting:
    """Fitness is worth the same where these are the same.

    Attributes:
        arena: name of a shipped arena, or path of its MJCF.
        task: what a trial is.
        start_clearance: least distance from the shell to a wall at a start [m].
    """

    arena: str
    task: TaskParameters
    start_clearance: float


@dataclass(frozen=True)
class Conditions:
    """Ideal robots, or such as there are.

    Attributes:
        noise: name of a level of `NOISE`.
        randomise: whether each trial has another robot.
        calibration: of the one robot that lives all trials; None for that of the books.
    """

    noise: str = "none"
    randomise: bool = False
    calibration: Calibration | None = None

    def __post_init__(self) -> None:
        """Refuse what excludes itself."""
        real = {"randomise": self.randomise, "calibration": self.calibration}
        asked = [name for name, value in real.items() if value]
        if asked and NOISE[self.noise] is None:
            raise ValueError(
                f"{asked[0]} needs noise: calibrated or strong, got {self.noise}"
            )
        if len(asked) > 1:
            raise ValueError(
                "expected randomise or calibration, got both: "
                "many robots or one that is known"
            )

    def draw(self, rng: np.random.Generator, n: int, steps: int) -> Disturbances | None:
        """What `n` trials of `steps` control steps meet; None for ideal robots."""
        level = NOISE[self.noise]
        if level is None:
            return None
        if self.calibration is not None:
            return calibrated(self.calibration, rng, n, steps, level)
        return draw(rng, n, steps, level, RANGES if self.randomise else BOOK)
