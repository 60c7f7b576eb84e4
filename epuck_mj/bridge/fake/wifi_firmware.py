"""An emulated e-puck2 that listens on TCP, selector at 15.

It sends nothing until its first command, then streams packets for ever, even without a
connection; the last speeds persist. Commands wait in a queue, from which each packet
takes one; commands that find the queue full are dropped. A packet holds proximity,
ambient light, steps and selector; everything else in it is zero.

The sources leave two things open. Here, bytes before a command's first byte are
skipped, and the robot continues to stream while it calibrates.

Source: GCtronic's wiki, "e-puck2 PC side development"; `socket_e-puck2.c`,
`uart_e-puck2.c`.
"""

import struct
from collections import deque

from epuck_mj.bridge.fake.motors_and_sensors import (
    Body,
    Motors,
    MotorTimer,
    ProximitySensors,
)
from epuck_mj.bridge.fake.talker import Talker
from epuck_mj.constants import (
    MOTOR_TICK_RATE_2,
    PROXIMITY_PERIOD_2,
    STEP_RATE_MAX,
    WIFI_PERIOD,
    WIFI_QUEUE,
)

TIMER = MotorTimer(STEP_RATE_MAX, MOTOR_TICK_RATE_2, saves_current=False)
"""Motor timing with the radio's speed limit, below that of the main processor."""

SELECTOR = 15
"""Position of the rotary switch at which an e-puck2 uses WiFi.

Source: GCtronic's wiki, "e-puck2 PC side development".
"""


class WifiFirmware(Talker):
    """An e-puck2's radio and main processor, from the moment it is switched on."""

    def __init__(self, body: Body, now: float) -> None:
        """Switch the robot on.

        Args:
            body: what it moves and senses with.
            now: the time [s].
        """
        super().__init__(body)
        self._motors = Motors(body, TIMER)
        self._sensors = ProximitySensors(body, PROXIMITY_PERIOD_2, now)
        self._buffer = b""
        self._queue: deque[bytes] = deque()
        self._streams: int | None = None
        self._n_packets = int(now / WIFI_PERIOD)

    def _advance(self, now: float) -> None:
        self._sensors.advance(now)
        due = int(now / WIFI_PERIOD) - self._n_packets
        for _ in range(due):
            self._n_packets += 1
            if self._queue:
                self._obey(self._queue.popleft())
            if self._streams is not None:
                self._out += self._packets(self._streams)

    def _hear(self, data: bytes) -> None:
        self._buffer += data
        while (start := self._buffer.find(0x80)) >= 0:
            if len(self._buffer) < start + 21:
                return
            if len(self._queue) < WIFI_QUEUE:
                self._queue.append(self._buffer[start : start + 21])
            self._buffer = self._buffer[start + 21 :]
        self._buffer = b""

    def _obey(self, command: bytes) -> None:
        self._streams, settings, left, right = struct.unpack_from("<BBhh", command, 1)
        if settings & 0b001:
            self._sensors.calibrate()
        self._motors.drive(left, right)

    def _packets(self, streams: int) -> bytes:
        image = b"\x01" + bytes(38400) if streams & 0b01 else b""
        if not streams & 0b10:
            return image or b"\x03"
        body = bytearray(104)
        struct.pack_into("<8H", body, 37, *self._sensors.proximity())
        struct.pack_into("<8H", body, 53, *self._sensors.ambient())
        struct.pack_into("<2h", body, 79, *self._motors.counters())
        body[89] = SELECTOR
        return image + b"\x02" + body
