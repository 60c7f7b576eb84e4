"""The robot's language as a link needs it: bytes only, no I/O.

A link works as follows:

1. one request at a time: send `request.out`, feed whatever comes to one
   `request.parser()`, for `request.patience` seconds;
2. a reply: done. What is left over then, in `parser.rest` or in the port, is dropped
   before the next request if that one is ASCII; if it is binary, go to step 3;
3. no reply in time, or BridgeError: the two are out of step; go through `RESYNC`,
   then send the speeds again, since it is unknown which speeds arrived;
4. RobotRestarted, or `greets` of what was dropped: the robot stands still and has lost
   its calibration.

An e-puck2 on a serial line speaks the same `ascii` and `binary`; over WiFi it speaks
`packets`. No firmware stops when the link is lost: send `ascii.stop_order()` on every
way out.

A reply does not name its request. These rules keep one from being taken for another:

- ASCII: letter, number of values, ranges. Two replies to equal requests look the same,
  so a request that was given up is followed by RESYNC, never by itself.
- binary: length, ranges, silence before it, and in `echoed_cycle_packet` the speeds.

Source: gctronic/e-puck-library, `Asercom.c`, `BTcom.c`; GCtronic's wiki, "Advanced
sercom protocol".
"""

from dataclasses import dataclass

from epuck_mj.bridge.language import ascii
from epuck_mj.bridge.language.parsing import BANNER, Request
from epuck_mj.bridge.language.replies import Version
from epuck_mj.constants import OPERANDS_MAX, RESYNC_QUIET


@dataclass(frozen=True)
class Resync:
    """Recipe by which host and robot synchronise again.

    Send `flush`; drop what comes until nothing came for `quiet` seconds; ask `barrier`.
    If its reply does not come, or not alone, do it again: what was left in the robot
    may have eaten the first.

    Attributes:
        flush: ends whatever the robot may still be waiting for.
        quiet: how long nothing has come when all has come [s].
        barrier: whose reply nothing older can be taken for.
    """

    flush: bytes
    quiet: float
    barrier: Request[Version]


RESYNC = Resync(
    # operands and the end of a binary packet, or the end of a half-sent line
    flush=bytes(OPERANDS_MAX + 1) + b"\r",
    quiet=RESYNC_QUIET,
    barrier=ascii.version_query(),
)
"""Recipe by which host and robot synchronise on a serial line.

Zeros are ignored between commands. The single return is followed by ASCII only: a
binary command right after it would be taken for a line. Whatever the zeros completed
has been carried out, speeds included.

Source: gctronic/e-puck-library, `Asercom.c` (inferred from reading it, not tried).
"""


def greets(data: bytes) -> bool:
    """Whether these bytes hold the banner of a robot that was reset."""
    return BANNER in data
