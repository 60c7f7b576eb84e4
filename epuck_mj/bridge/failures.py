"""What goes wrong between a host and its robot."""

from epuck_mj.errors import UserError

DONE, FAILED, RUNAWAY = 0, 3, 4
"""Exit statuses: as planned; broken off, standing still; perhaps still moving.

Beside 2 for what a user can put right before it starts, and 128 + signal.
"""


class BridgeError(UserError):
    """Not what was expected of the robot, or of what it is told."""

    def __init__(self, expected: str, came: str | bytes) -> None:
        """Say what was expected and what came; long bytes are shortened."""
        text = came if isinstance(came, str) else _shown(came)
        super().__init__(f"expected {expected}; came {text}")


class RobotRestarted(BridgeError):
    """The robot greets as it does after a reset, which nobody asked for.

    Its motors stand still, its step counters are zero, its calibration is lost.
    """


class NoReply(BridgeError):
    """The reply did not come in time, or not all of it."""


class LinkLost(BridgeError):
    """The port is gone: nobody hears us any more."""


class StaleReading(BridgeError):
    """Nobody knows what the robot senses now: it must not go on."""


class StillMoving(BridgeError):
    """The robot never said that it stopped."""


def _shown(came: bytes, limit: int = 60) -> str:
    """Bytes as a person reads them, the first `limit` of them."""
    if len(came) <= limit:
        return repr(came)
    return f"{came[:limit]!r} and {len(came) - limit} bytes more"
