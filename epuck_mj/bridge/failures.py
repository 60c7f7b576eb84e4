"""Failures between a host and its robot, for a person and in detail."""

from typing import ClassVar

from epuck_mj.constants import READING_AGE_MAX
from epuck_mj.errors import UserError

DONE, FAILED, RUNAWAY = 0, 3, 4
"""Exit statuses: as planned; broken off, standing still; perhaps still moving.

Beside 2 for what a user can put right before it starts, and 128 + signal.
"""

NOBODY_TALKS = (
    "Is it switched on and near enough, and its selector as docs/bridge.md says? "
    "Is another program using it?"
)


class BridgeError(UserError):
    """An unexpected reply of the robot, or an invalid request to it.

    Its text has all details; `told` makes a sentence for a person.

    Attributes:
        happened: what happened, as the beginning of a sentence.
        advice: what a person can try.
    """

    happened: ClassVar[str] = "the robot did not answer as an e-puck does"
    advice: ClassVar[str] = NOBODY_TALKS

    def __init__(self, expected: str, came: str | bytes) -> None:
        """Store what was expected and what came; long bytes are shortened."""
        text = came if isinstance(came, str) else _shown(came)
        super().__init__(f"expected {expected}; got {text}")


class RobotRestarted(BridgeError):
    """The robot sent its banner: it was reset unexpectedly.

    Its motors stand still, its step counters are zero, its calibration is lost.
    """

    happened = "the robot started anew, as after a reset or with an empty battery"
    advice = "Charge its battery, do not touch its reset button, then start it again."


class NoReply(BridgeError):
    """The reply did not come in time, or not all of it."""

    happened = "the robot did not answer"


class LinkLost(BridgeError):
    """The port was lost."""

    happened = "the connection to the robot was lost"
    advice = "Is it switched on, charged and near enough, and its cable plugged in?"


class StaleReading(BridgeError):
    """The latest reading is too old: the robot must be stopped."""

    happened = f"the robot did not answer for {READING_AGE_MAX:g} s"
    advice = "Is it near enough? Is another program using it?"


class ComputerBusy(StaleReading):
    """The latest reading is too old, because this computer was busy."""

    happened = f"this computer was busy and did not ask for {READING_AGE_MAX:g} s"
    advice = "Close other programs, then start it again."


class StillMoving(BridgeError):
    """The robot did not confirm that it stopped."""

    happened = "the robot did not confirm that it stopped"
    advice = "Switch it off."


def told(error: UserError, verbose: bool, done: str = "") -> str:
    """An error for a person, on one line: what happened, what was done, what to try.

    Args:
        error: any; only a BridgeError has details of its own.
        verbose: whether details follow.
        done: what was done about it, as the end of a sentence.
    """
    if not isinstance(error, BridgeError):
        return str(error)
    text = f"{error.happened}{done}. {error.advice}"
    return f"{text} Details: {error}" if verbose else text


STOPPED = ", so it was stopped and stands still"
"""What is done about a failure while a robot drives."""


def told_of_runaway(error: StillMoving, verbose: bool) -> str:
    """The warning that a robot may still drive, on one line, with what came before."""
    cause = error.__context__
    before = (
        f"; before that, {cause.happened}" if isinstance(cause, BridgeError) else ""
    )
    text = f"THE MOTORS MAY STILL TURN, switch the robot off: {error.happened}{before}."
    if not verbose:
        return text
    first = f"; at first: {cause}" if isinstance(cause, BridgeError) else ""
    return f"{text} Details: {error}{first}"


def _shown(came: bytes, limit: int = 60) -> str:
    """Readable text of the first `limit` bytes."""
    if len(came) <= limit:
        return repr(came)
    return f"{came[:limit]!r} and {len(came) - limit} bytes more"
