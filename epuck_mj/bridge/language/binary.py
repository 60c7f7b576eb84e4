"""The e-puck's binary dialect: packets of commands, ended by a zero.

Each command is one byte, its letter's code negated, with its operands behind; values
are 16 bits, low byte first. All replies come together after the zero, with no mark,
length or checksum. What can be told of them:

- too few bytes: nothing comes before the deadline;
- too many: raises, here if they come with the reply, in the link if they come later;
- counts beyond 12 bits, and the robot's banner: raise;
- `echoed_cycle_packet` ends in the commanded speeds, which we know: if a byte was lost
  and another one slipped in, or the robot was reset, they are not where they should be.

Not recognisable: a byte that was changed into another one within its range. So no bytes
may be under way when a packet is sent: see `protocol.RESYNC`.

Source: gctronic/e-puck-library, `Asercom.c` and `BTcom.c`.
"""

import struct

from epuck_mj.bridge.failures import BridgeError
from epuck_mj.bridge.language.ascii import refuse_fast_speeds
from epuck_mj.bridge.language.parsing import BytesParser, Request
from epuck_mj.bridge.language.replies import Cycle, Proximity, Steps
from epuck_mj.constants import N_PROXIMITY

PAIR = struct.Struct("<2h")
"""Values of the left and the right wheel."""

CYCLE = struct.Struct(f"<{N_PROXIMITY}h2h2h")
"""Proximity counts, step counters and commanded speeds."""


def letter_code(letter: str) -> bytes:
    """The byte that stands for a letter: its code, negated in two's complement."""
    return bytes([-ord(letter) & 0xFF])


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
    refuse_fast_speeds(left, right)

    def reply(data: bytes) -> Cycle:
        *counts, left_steps, right_steps, left_now, right_now = CYCLE.unpack(data)
        if (left_now, right_now) != (left, right):
            raise BridgeError(
                f"the commanded speeds {left} and {right}",
                f"{left_now} and {right_now}: out of step, or the robot was reset",
            )
        return Cycle(Proximity(tuple(counts)), Steps(left_steps, right_steps))

    told = letter_code("D") + PAIR.pack(left, right)
    asked = letter_code("N") + letter_code("Q") + letter_code("E") + b"\0"
    name = "D N Q E (checked cycle)"
    out = told + asked if changed else asked
    return Request(name, out, lambda: BytesParser(name, CYCLE.size, reply))
