"""What a bridge asks of a port and of a robot, whichever they are."""

from dataclasses import dataclass
from typing import Protocol

from epuck_mj.bridge.language.replies import Cycle


class Port(Protocol):
    """Where bytes go in and out."""

    def send(self, data: bytes) -> None:
        """Send it all, or raise LinkLost."""
        ...

    def receive(self, timeout: float) -> bytes:
        """What came, at the latest after `timeout` seconds; LinkLost if it is gone."""
        ...

    def close(self) -> None:
        """Let go of it, whatever its state."""
        ...


@dataclass(frozen=True)
class Greeting:
    """Who answered.

    Attributes:
        firmware: its version, and the hardware's if it says so.
        battery: its state, for a person.
    """

    firmware: str
    battery: str


class Connection(Protocol):
    """A way to a robot. All of it raises BridgeError if the robot does not comply.

    Attributes:
        n_repairs: how often host and robot had to find each other again.
    """

    n_repairs: int

    def greet(self) -> Greeting:
        """Who is there; its motors stand still."""
        ...

    def cycle(self, left: int, right: int, changed: bool, until: float) -> Cycle:
        """What it senses now.

        Args:
            left: speed [steps/s] of the left wheel, new if it `changed`.
            right: speed [steps/s] of the right wheel.
            changed: whether the robot has to be told.
            until: when to give up, by the clock.
        """
        ...

    def calibrate(self) -> None:
        """Its sensors read zero for what they see now."""
        ...

    def stop(self) -> None:
        """It stands still and said so; a lost port is opened again.

        Raises:
            StillMoving: if it did not say so in bounded time.
        """
        ...

    def close(self) -> None:
        """Let go of it."""
        ...
