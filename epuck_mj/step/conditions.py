"""Conditions: whether robots are ideal or have noise and differences, as real ones."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import word
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
        """Refuse conditions that exclude each other."""
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


@dataclass(frozen=True)
class ConditionFlags:
    """Command-line flags for noise and differences of the robots.

    Attributes:
        noise: none for ideal sensors and motors; calibrated for the noise of real ones;
            strong for more noise; default for the command's own default.
        randomise: give each trial a different robot; needs noise.
        randomise_all: give each trial a robot that differs in all that real ones differ
            in; needs noise.
        calibration: file written by python -m epuck_mj.calibrate: use that robot in all
            trials; needs noise.
    """

    noise: NoiseLevel | Literal["default"] = "default"
    randomise: bool = False
    randomise_all: bool = False
    calibration: Annotated[Path | None, word("FILE")] = None

    @property
    def conditions(self) -> Conditions | None:
        """The conditions that the flags ask for; None if no flag was given.

        Raises:
            UserError: if they exclude each other, or the file is no calibration.
        """
        if self == ConditionFlags():
            return None
        path = self.calibration
        robot = None if path is None else Calibration.load(path)
        noise = "none" if self.noise == "default" else self.noise
        try:
            return Conditions(noise, self.randomise, robot, self.randomise_all)
        except ValueError as error:
            raise UserError(str(error)) from None
