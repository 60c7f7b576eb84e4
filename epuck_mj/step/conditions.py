"""Conditions: what the robots are like that live the trials, ideal or as there are."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.disturbances import (
    BOOK,
    NOISE,
    RANGES,
    Disturbances,
    draw_calibrated,
    draw_disturbances,
)

NoiseLevel = Literal["none", "calibrated", "strong"]
"""Names of the levels in `NOISE`."""


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
            return draw_calibrated(self.calibration, rng, n, steps, level)
        return draw_disturbances(
            rng, n, steps, level, RANGES if self.randomise else BOOK
        )

    @classmethod
    def asked(
        cls, noise: NoiseLevel | None, randomise: bool, calibration: Path | None
    ) -> Self | None:
        """What a person's flags say; None if none of them was given.

        Raises:
            UserError: if they exclude each other, or the file is no calibration.
        """
        if noise is None and not randomise and calibration is None:
            return None
        robot = None if calibration is None else Calibration.load(calibration)
        try:
            return cls(noise or "none", randomise, robot)
        except ValueError as error:
            raise UserError(str(error)) from None

    def __str__(self) -> str:
        """In words: `noise calibrated, other robots`."""
        robots = ", other robots" if self.randomise else ""
        robots += ", one calibrated robot" if self.calibration is not None else ""
        return f"noise {self.noise}{robots}"
