"""Replies of an e-puck, in every dialect."""

from dataclasses import dataclass

from epuck_mj.bridge.failures import BridgeError
from epuck_mj.constants import N_PROXIMITY, N_SELECTOR, PROXIMITY_COUNT_MAX


@dataclass(frozen=True)
class Acknowledged:
    """Reply that the robot has carried out a command."""


@dataclass(frozen=True)
class Version:
    """Firmware version of the robot.

    Attributes:
        lines: the firmware's line and, if the robot has one, the hardware's.
    """

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Battery:
    """State of the robot's battery.

    Attributes:
        state: `1` if it is good and `0` if it is low; of some, a raw value and per
            cent.
    """

    state: str

    def __str__(self) -> str:
        """The battery's state in words."""
        return {"0": "low", "1": "good"}.get(self.state, self.state)


@dataclass(frozen=True)
class Proximity:
    """Proximity counts ps0..ps7, growing as things come near.

    Attributes:
        counts: `(8,)`, each 0 to 4095.
    """

    counts: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse what 12 bits cannot say."""
        _refuse_bad_counts("proximity", self.counts)


@dataclass(frozen=True)
class Steps:
    """Step counters, wrapping at +-32768.

    Attributes:
        left: of the left motor [steps].
        right: of the right motor [steps].
    """

    left: int
    right: int


@dataclass(frozen=True)
class Cycle:
    """Proximity counts and step counters of a control step.

    Attributes:
        proximity: the proximity counts.
        steps: the step counters.
    """

    proximity: Proximity
    steps: Steps


@dataclass(frozen=True)
class Sensors:
    """Values of an e-puck2's sensor packet that the bridge uses.

    Attributes:
        proximity: the proximity counts.
        ambient: light counts of the sensors ps0..ps7, growing as it gets dark, `(8,)`,
            each 0 to 4095.
        steps: the step counters.
        selector: position of the selector, 0 to 15.
    """

    proximity: Proximity
    ambient: tuple[int, ...]
    steps: Steps
    selector: int

    def __post_init__(self) -> None:
        """Refuse light beyond 12 bits, and a selector with too many positions."""
        _refuse_bad_counts("ambient light", self.ambient)
        if not 0 <= self.selector < N_SELECTOR:
            raise BridgeError(
                f"a selector from 0 to {N_SELECTOR - 1}", f"{self.selector}"
            )


def _refuse_bad_counts(name: str, counts: tuple[int, ...]) -> None:
    if len(counts) != N_PROXIMITY or not all(
        0 <= count <= PROXIMITY_COUNT_MAX for count in counts
    ):
        raise BridgeError(
            f"{N_PROXIMITY} {name} counts from 0 to {PROXIMITY_COUNT_MAX}", f"{counts}"
        )


def wrapped(count: int) -> int:
    """The count as a signed integer of 16 bits."""
    return (count + 2**15) % 2**16 - 2**15
