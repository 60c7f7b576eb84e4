"""Calibration: the sensor gains, wheels and delays of one robot.

Made by `python -m epuck_mj.calibrate`, measured or fitted to a log; read by simulation
and bridge alike.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np

from epuck_mj.constants import N_PROXIMITY, N_WHEELS, TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.host.files import write_text, writing
from epuck_mj.host.limits import check, shown
from epuck_mj.host.yaml_and_json import read_yaml, to_yaml


@dataclass(frozen=True)
class Calibration:
    """Sensor gains, wheel radii, track and delays of one robot.

    Attributes:
        proximity_gains: counts of each sensor against the mean sensor's.
        wheel_radii: on which the robot rolls, left and right [m].
        track: effective distance of the wheels [m].
        latency: control steps until a command has reached the wheels.
        lag: time constants of the drive against the nominal robot's.
    """

    proximity_gains: tuple[float, ...] = (1.0,) * N_PROXIMITY
    wheel_radii: tuple[float, ...] = (WHEEL_RADIUS,) * N_WHEELS
    track: float = TRACK
    latency: int = 0
    lag: float = 1.0

    def __post_init__(self) -> None:
        """Refuse values that no robot has."""
        for name, size in (("proximity_gains", N_PROXIMITY), ("wheel_radii", N_WHEELS)):
            numbers = getattr(self, name)
            if not (isinstance(numbers, tuple) and len(numbers) == size):
                raise ValueError(f"expected {size} {name}, got {shown(numbers)}")
        for gain in self.proximity_gains:
            check("gain", gain, "proximity_gains")
        for radius in self.wheel_radii:
            check("length", radius, "wheel_radii")
        check("length", self.track, "track")
        check("latency", self.latency)
        check("lag", self.lag)

    @property
    def gains(self) -> np.ndarray:
        """Gains of the proximity sensors, `(8,)`."""
        return np.array(self.proximity_gains)

    @property
    def wheel_radius(self) -> float:
        """Mean of both wheels [m]."""
        return sum(self.wheel_radii) / N_WHEELS

    def save(self, path: Path) -> None:
        """Write the calibration as YAML.

        Raises:
            UserError: if that is not possible.
        """
        # plain floats: YAML knows no numpy
        content = {
            "proximity_gains": [float(gain) for gain in self.proximity_gains],
            "wheel_radii": [float(radius) for radius in self.wheel_radii],
            "track": float(self.track),
            "latency": int(self.latency),
            "lag": float(self.lag),
        }
        with writing():
            write_text(path, to_yaml(content))

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote.

        Raises:
            UserError: if the file is missing, damaged or something else.
        """
        try:
            return cls.from_dict(read_yaml(path))
        except ValueError as error:
            raise UserError(f"'{path}' is not a calibration: {error}") from None

    @classmethod
    def from_dict(cls, content: Any) -> Self:
        """Read keys and values; missing ones are those of the nominal robot.

        Raises:
            ValueError: if they are no calibration's.
        """
        keys = [field.name for field in fields(cls)]
        if not isinstance(content, dict):
            raise ValueError(f"expected keys of {', '.join(keys)}")
        if unknown := [str(key) for key in content if key not in keys]:
            raise ValueError(
                f"unknown {', '.join(unknown)}; available: {', '.join(keys)}"
            )
        lists_as_tuples: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value
            for key, value in content.items()
        }
        return cls(**lists_as_tuples)
