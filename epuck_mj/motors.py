"""From what the network says to what the wheels are told."""

from dataclasses import dataclass

import numpy as np

from epuck_mj.constants import (
    SPEED_MAX,
    TRACK,
    TURN_RATE_MAX,
    WHEEL_RADIUS,
    WHEEL_SPEED_MAX,
)


@dataclass(frozen=True)
class Speeds:
    """What a full action means: v = 1 and |w| = 1 in SI units.

    Attributes:
        forward: speed at v = 1 [m/s].
        turn: yaw rate at |w| = 1 [rad/s].
    """

    forward: float = SPEED_MAX
    turn: float = TURN_RATE_MAX


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
