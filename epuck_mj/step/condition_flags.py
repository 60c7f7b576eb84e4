"""Command-line flags for noise and differences of the robots."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import word
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.conditions import Conditions, NoiseLevel


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
