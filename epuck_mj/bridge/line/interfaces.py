"""Interfaces of a port and of a connection to a robot."""

from dataclasses import dataclass
from typing import Protocol

from epuck_mj.bridge.language.replies import Cycle

POLL_TIME = 0.01
"""How long one read of a port waits for its first byte [s]."""

WRITE_TIME_MAX = 0.2
"""Time without accepting bytes after which a port is lost [s]. Chosen.

If a port accepts no bytes for longer, the robot can be stopped only on a new port.
"""

READ_MAX = 4096
"""Largest number of bytes read at once."""


class Port(Protocol):
    """A port that sends and receives bytes."""

    def send(self, data: bytes) -> None:
        """Send all bytes, or raise LinkLost."""
        ...

    def receive(self, timeout: float) -> bytes:
        """Bytes that came, after `timeout` seconds at most; LinkLost if it is gone."""
        ...

    def close(self) -> None:
        """Close the port, in any state."""
        ...


@dataclass(frozen=True)
class Greeting:
    """Version and battery of the robot that answered.

    Attributes:
        firmware: its version, and the hardware's if it says so.
        battery: its state, for a person.
    """

    firmware: str
    battery: str


class Connection(Protocol):
    """A connection to a robot, which raises BridgeError if the robot does not comply.

    Attributes:
        n_repairs: how often host and robot had to find each other again.
    """

    n_repairs: int

    def greet(self) -> Greeting:
        """Greet the robot and stop its motors."""
        ...

    def cycle(self, left: int, right: int, changed: bool, until: float) -> Cycle:
        """Command speeds; what the robot senses now.

        Args:
            left: speed [steps/s] of the left wheel, new if it `changed`.
            right: speed [steps/s] of the right wheel.
            changed: whether the robot has to be told.
            until: when to give up, by the clock.
        """
        ...

    def calibrate(self) -> None:
        """Set the sensors' zero to what they see now."""
        ...

    def stop(self) -> None:
        """Tell the robot to stop until it confirms; a lost port is opened again.

        Raises:
            StillMoving: if it did not confirm in bounded time.
        """
        ...

    def close(self) -> None:
        """Close the connection."""
        ...
