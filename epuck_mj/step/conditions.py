"""Conditions: whether robots are ideal or have noise and differences, as real ones."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from epuck_mj.host.limits import shown
from epuck_mj.host.memory import TRACK_BYTES, check_memory
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.disturbances import (
    ALL_RANGES,
    BOOK,
    NOISE,
    RANGES,
    Disturbances,
    Ranges,
    draw_calibrated,
    draw_disturbances,
)

NoiseLevel = Literal["none", "calibrated", "strong"]
"""Names of the levels in `NOISE`."""


@dataclass(frozen=True)
class Conditions:
    """Noise, randomisation and calibration of the robots of trials.

    Attributes:
        noise: name of a level of `NOISE`.
        randomise: whether each trial has a different robot.
        randomise_all: whether these differ in all that real ones differ in.
        calibration: calibration of the robot of all trials; None for the nominal robot.
    """

    noise: str = "none"
    randomise: bool = False
    calibration: Calibration | None = None
    randomise_all: bool = False

    def __post_init__(self) -> None:
        """Refuse an unknown level, and conditions that exclude each other."""
        if self.noise not in NOISE:
            raise ValueError(
                f"unknown noise {shown(self.noise)}; available: {', '.join(NOISE)}"
            )
        real = {
            "randomise": self.randomise,
            "randomise_all": self.randomise_all,
            "calibration": self.calibration,
        }
        asked = [name for name, value in real.items() if value]
        if asked and NOISE[self.noise] is None:
            raise ValueError(
                f"{asked[0]} needs noise: calibrated or strong, got {self.noise}"
            )
        if self.calibration is not None and len(asked) > 1:
            raise ValueError(f"expected {asked[0]} or calibration, got both")

    def draw(self, rng: np.random.Generator, n: int, steps: int) -> Disturbances | None:
        """Disturbances of `n` trials of `steps` steps; None for ideal robots.

        Raises:
            UserError: if they need more memory than there is.
        """
        level = NOISE[self.noise]
        if level is None:
            return None
        noise = f"noise of {n:,} trials of {steps:,} control steps"
        check_memory(noise, n * steps * TRACK_BYTES)
        if self.calibration is not None:
            return draw_calibrated(self.calibration, rng, n, steps, level)
        return draw_disturbances(rng, n, steps, level, self.ranges)

    @property
    def ranges(self) -> Ranges:
        """Ranges in which the robots differ, without a calibration."""
        if self.randomise_all:
            return ALL_RANGES
        return RANGES if self.randomise else BOOK

    def __str__(self) -> str:
        """In words: `noise calibrated, other robots`."""
        robots = ", other robots" if self.randomise or self.randomise_all else ""
        robots += " in everything" if self.randomise_all else ""
        robots += ", one calibrated robot" if self.calibration is not None else ""
        return f"noise {self.noise}{robots}"
