"""Motors, sensors and body of the emulated e-puck, below its firmware.

The body is anything with wheels and sensors, for instance a robot in MuJoCo. This
module times its motors and sensors as the firmware's timers do.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from epuck_mj.bridge.language.replies import wrapped
from epuck_mj.constants import (
    CALIBRATION_SAMPLES,
    COIL_ALWAYS_ON,
    COIL_TICKS,
    N_PROXIMITY,
)
from epuck_mj.step.motors import actual_rates


@dataclass(frozen=True)
class Wheel:
    """What a motor does until the next command.

    Attributes:
        rate: speed at which it really turns [steps/s]; forward is positive.
        pause: it stands still for so long before it goes on [s]. What is left of an
            earlier pause is void.
    """

    rate: float
    pause: float


class Body(Protocol):
    """Body of a robot, as the firmware needs it."""

    def drive(self, left: Wheel, right: Wheel) -> None:
        """Turn the wheels at these speeds until the next call."""
        ...

    def steps(self) -> tuple[int, int]:
        """Steps that the left and the right motor have made in all, not wrapped."""
        ...

    def proximity(self) -> np.ndarray:
        """Counts ps0..ps7 before calibration, `(8,)`, int, 0 to 4095."""
        ...

    def ambient(self) -> np.ndarray:
        """Counts of ambient light, high in the dark, `(8,)`, int, 0 to 4095."""
        ...

    def selector(self) -> int:
        """Position of the selector, 0 to 15."""
        ...

    def battery(self) -> float:
        """Voltage of the battery [V]."""
        ...


@dataclass(frozen=True)
class MotorTimer:
    """How a firmware times its motors.

    Attributes:
        speed_max: speeds beyond it are made smaller in silence [steps/s].
        tick_rate: a step takes a whole number of ticks [1/s].
        saves_current: whether a slow motor's coil is switched off after each step.
    """

    speed_max: int
    tick_rate: int
    saves_current: bool

    def wheel(self, speed: int, before: int) -> Wheel:
        """What a commanded speed does to a motor.

        It turns at its `actual_rates`; but each command makes a slow one of a v1 late.
        Its timer counts c = 15 ticks with the coil on, then the other p - c of the
        period. A command makes p of what is being counted, and counting goes on: the
        step is p - c ticks late with a probability of c/p, and c ticks otherwise,
        2 c (p - c)/p in the mean. This holds for commands that come no faster than
        steps.

        Args:
            speed: as commanded [steps/s].
            before: the speed before [steps/s].

        Source: derived from e-puck-library, `e_motors.c` and `e_agenda.c`.
        """
        speed = self._saturated(speed)
        if speed == 0:
            return Wheel(0.0, 0.0)
        rate = float(actual_rates(np.array(speed), self.tick_rate))
        pause = 0.0
        if self._is_slow(speed) and self._is_slow(self._saturated(before)):
            period = self.tick_rate / abs(rate)
            late = 2 * COIL_TICKS * (period - COIL_TICKS) / period
            pause = late / self.tick_rate
        return Wheel(rate, pause)

    def _saturated(self, speed: int) -> int:
        return max(-self.speed_max, min(self.speed_max, speed))

    def _is_slow(self, speed: int) -> bool:
        return self.saves_current and 0 < abs(speed) < COIL_ALWAYS_ON


class Motors:
    """Both motors and their counters.

    Attributes:
        commanded: speeds that `drive` was last called with [steps/s].
    """

    def __init__(self, body: Body, timer: MotorTimer) -> None:
        """Motors that stand still, with counters at zero.

        Args:
            body: what they move.
            timer: how they are timed.
        """
        self._body = body
        self._timer = timer
        self._speeds = (0, 0)
        self.drive(0, 0)
        self.count_from(0, 0)

    def drive(self, left: int, right: int) -> None:
        """Turn at these speeds [steps/s], as exactly as the motors can."""
        self.commanded = (left, right)
        self._turn(left, right)

    def stop(self) -> None:
        """Stand still; `commanded` stays what it was."""
        self._turn(0, 0)

    def count_from(self, left: int, right: int) -> None:
        """Set the counters [steps]."""
        made = self._body.steps()
        self._origin = (made[0] - left, made[1] - right)

    def counters(self) -> tuple[int, int]:
        """Steps since the counters were set, in 16 bits."""
        left, right = self._body.steps()
        return wrapped(left - self._origin[0]), wrapped(right - self._origin[1])

    def _turn(self, left: int, right: int) -> None:
        before, self._speeds = self._speeds, (left, right)
        self._body.drive(*map(self._timer.wheel, self._speeds, before))


class ProximitySensors:
    """The proximity sensors, sampled periodically, and their calibration.

    Attributes:
        n_told: how often their counts were asked for.
    """

    def __init__(self, body: Body, period: float, now: float) -> None:
        """Start without a calibration.

        Args:
            body: what senses.
            period: time between two samples [s].
            now: the time [s].
        """
        self._body = body
        self._period = period
        self._offset = np.zeros(N_PROXIMITY, int)
        self._sum = np.zeros(N_PROXIMITY, int)
        self._missing = 0
        self.n_told = 0
        self._n_samples = int(now / period)
        self._read()

    @property
    def calibrating(self) -> bool:
        """Whether samples for the offsets are being taken."""
        return self._missing > 0

    def calibrate(self) -> None:
        """Start a calibration: the mean of the next samples becomes the offsets."""
        self._sum[:] = 0
        self._missing = CALIBRATION_SAMPLES

    def advance(self, now: float) -> None:
        """Take the samples that are due at a time [s], never less than before."""
        due = int(now / self._period) - self._n_samples
        if due <= 0:
            return
        self._n_samples += due
        self._read()
        if self.calibrating:
            n_samples = min(due, self._missing)
            self._sum += n_samples * self._proximity
            self._missing -= n_samples
            if not self.calibrating:
                self._offset = self._sum // CALIBRATION_SAMPLES

    def proximity(self) -> list[int]:
        """Counts at the last sample, less the offsets, never negative."""
        self.n_told += 1
        return np.maximum(self._proximity - self._offset, 0).tolist()

    def ambient(self) -> list[int]:
        """Counts of ambient light at the last sample."""
        return self._ambient.tolist()

    def _read(self) -> None:
        self._proximity = np.array(self._body.proximity())
        self._ambient = np.array(self._body.ambient())
