"""Motors: from the network's action to commands and true wheel speeds."""

from dataclasses import dataclass

import numpy as np

from epuck_mj.constants import (
    MOTOR_TICK_RATE,
    SPEED_MAX,
    STEP_RATE_MAX,
    STEPS_PER_REVOLUTION,
    TRACK,
    TURN_RATE_MAX,
    WHEEL_RADIUS,
    WHEEL_SPEED_MAX,
)
from epuck_mj.host.limits import check

STEP_ANGLE = 2 * np.pi / STEPS_PER_REVOLUTION
"""Angle by which a wheel turns in one step of its motor [rad]."""


@dataclass(frozen=True)
class Speeds:
    """Speeds of a full action: v = 1 and |w| = 1 in SI units.

    Attributes:
        forward: speed at v = 1 [m/s].
        turn: yaw rate at |w| = 1 [rad/s].

    Raises:
        ValueError: a speed that no e-puck has.
    """

    forward: float = SPEED_MAX
    turn: float = TURN_RATE_MAX

    def __post_init__(self) -> None:
        """Refuse values beyond their limits."""
        check("v_max", self.forward, "forward")
        check("w_max", self.turn, "turn")


def command(action: np.ndarray, speeds: Speeds) -> np.ndarray:
    """Wheel speeds for an action, saturated where the firmware saturates.

    Args:
        action: `(..., 2)`: v in [0, 1] and w in [-1, 1]; w > 0 turns right.
        speeds: what a full action means.

    Returns:
        Left and right wheel speed [rad/s], `(..., 2)`, within +-1000 steps/s each.

    Source: paper, section 4 (signs); two-wheel kinematics.
    """
    forward = action[..., 0] * (speeds.forward / WHEEL_RADIUS)
    turn = action[..., 1] * (speeds.turn * TRACK / (2 * WHEEL_RADIUS))
    wheels = np.empty_like(action)
    np.add(forward, turn, out=wheels[..., 0])
    np.subtract(forward, turn, out=wheels[..., 1])
    return np.clip(wheels, -WHEEL_SPEED_MAX, WHEEL_SPEED_MAX, out=wheels)


def step_rates(command: np.ndarray) -> np.ndarray:
    """Commands as the firmware takes them: whole steps/s within +-1000, `(...)`, int.

    Args:
        command: wheel speeds [rad/s], `(...)`.
    """
    rates = np.rint(np.asarray(command) / STEP_ANGLE)
    return np.clip(rates, -STEP_RATE_MAX, STEP_RATE_MAX).astype(int)


def actual_rates(rates: np.ndarray, tick_rate: int = MOTOR_TICK_RATE) -> np.ndarray:
    """Speeds at which motors told `rates` really turn [steps/s], `(...)`.

    A step takes a whole number of ticks, rounded down, so no motor is slower than told.

    Args:
        rates: whole steps/s, `(...)`, no more than the firmware accepts.
        tick_rate: of the firmware's timer [1/s]; an e-puck v1's if not given.

    Source: derived from e-puck-library, `e_motors.c` and `e_agenda.c`; for an e-puck2,
    e-puck2_main-processor, `motors.c`.
    """
    rates = np.asarray(rates)
    ticks = tick_rate // np.maximum(np.abs(rates), 1)
    return np.sign(rates) * (tick_rate / ticks)


def wheel_speeds(rates: np.ndarray) -> np.ndarray:
    """Wheel speeds [rad/s] of motors that make `rates` [steps/s], `(...)`."""
    return rates * STEP_ANGLE
