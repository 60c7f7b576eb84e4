"""The e-puck's binary dialect: packets of commands, ended by a zero.

Each command is one byte, its letter's code negated, with its operands behind; values
are 16 bits, low byte first. All replies come together after the zero, with no mark,
length or checksum. What can be told of them:

- too few bytes: nothing comes before the deadline;
- too many: raises, here if they come with the reply, in the link if they come later;
- counts beyond 12 bits, and the robot's banner: raise;
- `echoed_cycle_packet` ends in the commanded speeds, which we know: if a byte was lost
  and another one slipped in, or the robot was reset, they are not where they should be.

Not recognisable: a byte changed into another within its range; in `cycle_packet`, a
byte too many before a byte too few when counts are small. So nothing may be under way
when a packet is sent: see `protocol.RESYNC`.

Source: gctronic/e-puck-library, `Asercom.c` and `BTcom.c`.
"""

import struct
from collections.abc import Callable

from epuck_mj.bridge.failures import BridgeError
from epuck_mj.bridge.language.ascii import refuse_fast_speeds
from epuck_mj.bridge.language.parsing import BytesParser, Request, T
from epuck_mj.bridge.language.replies import (
    Ambient,
    CommandedSpeeds,
    Cycle,
    Proximity,
    Steps,
)
from epuck_mj.constants import N_PROXIMITY

COUNTS = struct.Struct(f"<{N_PROXIMITY}h")
"""Proximity or ambient light counts."""

PAIR = struct.Struct("<2h")
"""Values of the left and the right wheel."""


def letter_code(letter: str) -> bytes:
    """The byte that stands for a letter: its code, negated in two's complement."""
    return bytes([-ord(letter) & 0xFF])


def proximity_packet() -> Request[Proximity]:
    """N: the proximity counts."""
    return _request("N (proximity)", letter_code("N"), COUNTS.size, _proximity)


def ambient_packet() -> Request[Ambient]:
    """O: the ambient light counts."""
    return _request(
        "O (ambient light)",
        letter_code("O"),
        COUNTS.size,
        lambda data: Ambient(COUNTS.unpack(data)),
    )


def steps_packet() -> Request[Steps]:
    """Q: the step counters."""
    return _request("Q (step counters)", letter_code("Q"), PAIR.size, _steps)


def speeds_packet() -> Request[CommandedSpeeds]:
    """E: the speeds last commanded."""
    return _request("E (commanded speeds)", letter_code("E"), PAIR.size, _speeds)


def drive_packet(left: int, right: int) -> Request[CommandedSpeeds]:
    """D, and E to have an answer: alone, D has none.

    Args:
        left: of the left motor [steps/s].
        right: of the right motor [steps/s].

    Raises:
        BridgeError: beyond +-1000; in the reply, if other speeds come back.
    """
    expected = CommandedSpeeds(left, right)

    def reply(data: bytes) -> CommandedSpeeds:
        _refuse_other_speeds(expected, _speeds(data))
        return expected

    out = _drive(left, right) + letter_code("E")
    return _request("D E (speeds)", out, PAIR.size, reply)


def cycle_packet(left: int, right: int) -> Request[Cycle]:
    """D, N and Q: a control step in one packet of 8 bytes, answered by 20.

    Args:
        left: of the left motor [steps/s].
        right: of the right motor [steps/s].

    Raises:
        BridgeError: beyond +-1000.
    """
    out = _drive(left, right) + letter_code("N") + letter_code("Q")
    return _request("D N Q (cycle)", out, COUNTS.size + PAIR.size, _cycle)


def echoed_cycle_packet(left: int, right: int, changed: bool) -> Request[Cycle]:
    """D if speeds change, N, Q, and E as a check: answered by 24 bytes.

    An e-puck v1 loses up to half a step each time it hears the same speeds again.

    Args:
        left: of the left motor [steps/s].
        right: of the right motor [steps/s].
        changed: whether the robot has to be told: not if a packet with the same speeds
            was answered, and nothing else has moved it since.

    Raises:
        BridgeError: beyond +-1000; in the reply, if other speeds come back.
    """
    expected = CommandedSpeeds(left, right)

    def reply(data: bytes) -> Cycle:
        _refuse_other_speeds(expected, _speeds(data[-PAIR.size :]))
        return _cycle(data[: -PAIR.size])

    told = _drive(left, right)
    asked = letter_code("N") + letter_code("Q") + letter_code("E")
    out = told + asked if changed else asked
    length = COUNTS.size + 2 * PAIR.size
    return _request("D N Q E (checked cycle)", out, length, reply)


def _request(
    name: str, out: bytes, length: int, reply: Callable[[bytes], T]
) -> Request[T]:
    return Request(name, out + b"\0", lambda: BytesParser(name, length, reply))


def _drive(left: int, right: int) -> bytes:
    refuse_fast_speeds(left, right)
    return letter_code("D") + PAIR.pack(left, right)


def _proximity(data: bytes) -> Proximity:
    return Proximity(COUNTS.unpack(data))


def _steps(data: bytes) -> Steps:
    return Steps(*PAIR.unpack(data))


def _speeds(data: bytes) -> CommandedSpeeds:
    return CommandedSpeeds(*PAIR.unpack(data))


def _cycle(data: bytes) -> Cycle:
    return Cycle(_proximity(data[: COUNTS.size]), _steps(data[COUNTS.size :]))


def _refuse_other_speeds(expected: CommandedSpeeds, came: CommandedSpeeds) -> None:
    if came != expected:
        raise BridgeError(
            f"the commanded speeds {expected.left} and {expected.right}",
            f"{came.left} and {came.right}: out of step, or the robot was reset",
        )
