"""Calibration: in what one robot differs from the robot of the books.

Made by `python -m epuck_mj.calibrate`, read by simulation and bridge alike.
"""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
import yaml

from epuck_mj.constants import N_PROXIMITY, TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.files import write_text, writing


@dataclass(frozen=True)
class Calibration:
    """One robot.

    Attributes:
        proximity_gains: counts of each sensor against the mean sensor's.
        wheel_radius: on which the robot rolls [m].
        track: effective distance of the wheels [m].
    """

    proximity_gains: tuple[float, ...] = (1.0,) * N_PROXIMITY
    wheel_radius: float = WHEEL_RADIUS
    track: float = TRACK

    def __post_init__(self) -> None:
        """Refuse what no robot has."""
        numbers = (*self.proximity_gains, self.wheel_radius, self.track)
        real = (int, float)
        if len(self.proximity_gains) != N_PROXIMITY or not all(
            isinstance(number, real) and math.isfinite(number) and number > 0
            for number in numbers
        ):
            raise ValueError(
                f"expected {N_PROXIMITY} gains, a wheel radius and a track, all above "
                f"0, got {numbers}"
            )

    @property
    def gains(self) -> np.ndarray:
        """Of the proximity sensors, `(8,)`."""
        return np.array(self.proximity_gains)

    def save(self, path: Path) -> None:
        """Write YAML.

        Raises:
            UserError: if that is not possible.
        """
        # plain floats: YAML knows no numpy
        content = {
            "proximity_gains": [float(gain) for gain in self.proximity_gains],
            "wheel_radius": float(self.wheel_radius),
            "track": float(self.track),
        }
        with writing(path.parent):
            write_text(path, yaml.safe_dump(content, sort_keys=False))

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote.

        Raises:
            UserError: if the file is missing, damaged or something else.
        """
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
            if not isinstance(content, dict):
                raise ValueError("expected keys and values")
            gains = content.get("proximity_gains", (1.0,) * N_PROXIMITY)
            return cls(**{**content, "proximity_gains": tuple(gains)})
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            reason = " ".join(str(error).split())
            raise UserError(f"cannot read calibration '{path}': {reason}") from None
        except (TypeError, ValueError) as error:
            keys = ", ".join(field.name for field in fields(cls))
            raise UserError(
                f"'{path}' is not a calibration: {error}; keys: {keys}"
            ) from None
