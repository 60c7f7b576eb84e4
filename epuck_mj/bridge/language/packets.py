"""The e-puck2's dialect over WiFi: 21-byte commands, a stream of packets back.

After the first command packets come by themselves, so the next packet may be older
than the last command. TCP loses no byte: a packet of an unknown kind means that the
other side is no e-puck2, and only connecting anew helps. Not recognisable: anything
wrong within a packet that leaves counts in 12 bits and the selector in 0 to 15.

Source: GCtronic's wiki, "e-puck2 PC side development"; `socket_e-puck2.c`.
"""

import struct

from epuck_mj.bridge.failures import BridgeError
from epuck_mj.bridge.language.ascii import refuse_fast_speeds
from epuck_mj.bridge.language.binary import PAIR
from epuck_mj.bridge.language.replies import Proximity, Sensors, Steps
from epuck_mj.constants import N_PROXIMITY

COMMAND_BYTES = 21
"""Length of a command."""

COMMAND = 0x80
"""First byte of a command."""

STREAM_SENSORS = 0b10
"""Bit of a command's byte 1: sensors are to be streamed."""

CALIBRATE = 0b001
"""Bit of a command's byte 2: the proximity sensors' offsets are measured anew."""

IMAGE, SENSORS, EMPTY = 0x01, 0x02, 0x03
"""First byte of a packet, its kind."""

BODY_BYTES = {IMAGE: 160 * 120 * 2, SENSORS: 104, EMPTY: 0}
"""Bytes of a packet after its kind."""

AT_PROXIMITY, AT_AMBIENT, AT_STEPS, AT_SELECTOR = 37, 53, 79, 89
"""Offsets in a sensor packet, without its first byte, the kind."""

UNSIGNED_COUNTS = struct.Struct(f"<{N_PROXIMITY}H")


def wifi_command(left: int, right: int, calibrate: bool = False) -> bytes:
    """A command: speeds, sensors to be streamed, LEDs and sound off.

    Args:
        left: of the left motor [steps/s].
        right: of the right motor [steps/s].
        calibrate: the proximity sensors; nothing may be in their range.

    Returns:
        21 bytes.

    Raises:
        BridgeError: beyond +-1000, where the robot would saturate in silence.
    """
    refuse_fast_speeds(left, right)
    head = bytes([COMMAND, STREAM_SENSORS, CALIBRATE if calibrate else 0])
    return (head + PAIR.pack(left, right)).ljust(COMMAND_BYTES, b"\0")


class PacketParser:
    """Parser that cuts the bytes of one connection to an e-puck2 into packets."""

    def __init__(self) -> None:
        """Start without bytes."""
        self._buffer = b""

    def feed(self, data: bytes) -> list[Sensors]:
        """Add bytes; the completed sensor packets, oldest first, without images.

        Args:
            data: what came, any number of bytes.

        Raises:
            BridgeError: if this is no packet of an e-puck2.
        """
        self._buffer += data
        found = []
        while self._buffer:
            kind = self._buffer[0]
            if kind not in BODY_BYTES:
                raise BridgeError("a packet of kind 1, 2 or 3", self._buffer)
            end = 1 + BODY_BYTES[kind]
            if len(self._buffer) < end:
                break
            body, self._buffer = self._buffer[1:end], self._buffer[end:]
            if kind == SENSORS:
                found.append(sensors_in(body))
        return found


def sensors_in(body: bytes) -> Sensors:
    """Values of a sensor packet that the bridge uses.

    Args:
        body: its 104 bytes.

    Raises:
        BridgeError: if counts or selector are out of their range.
    """
    return Sensors(
        Proximity(UNSIGNED_COUNTS.unpack_from(body, AT_PROXIMITY)),
        UNSIGNED_COUNTS.unpack_from(body, AT_AMBIENT),
        Steps(*PAIR.unpack_from(body, AT_STEPS)),
        body[AT_SELECTOR],
    )
