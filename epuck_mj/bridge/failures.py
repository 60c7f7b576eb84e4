"""Failures between a host and its robot."""

from epuck_mj.errors import UserError

DONE, FAILED, RUNAWAY = 0, 3, 4
"""Exit statuses: as planned; broken off, standing still; perhaps still moving.

Beside 2 for what a user can put right before it starts, and 128 + signal.
"""


class BridgeError(UserError):
    """An unexpected reply of the robot, or an invalid request to it."""

    def __init__(self, expected: str, came: str | bytes) -> None:
        """Store what was expected and what came; long bytes are shortened."""
        text = came if isinstance(came, str) else _shown(came)
        super().__init__(f"expected {expected}; came {text}")


class RobotRestarted(BridgeError):
    """The robot sent its banner: it was reset unexpectedly.

    Its motors stand still, its step counters are zero, its calibration is lost.
    """


class NoReply(BridgeError):
    """The reply did not come in time, or not all of it."""


class LinkLost(BridgeError):
    """The port is gone."""


class StaleReading(BridgeError):
    """The latest reading is too old: the robot must be stopped."""


class StillMoving(BridgeError):
    """The robot did not confirm that it stopped."""


def _shown(came: bytes, limit: int = 60) -> str:
    """Readable text of the first `limit` bytes."""
    if len(came) <= limit:
        return repr(came)
    return f"{came[:limit]!r} and {len(came) - limit} bytes more"
