"""An emulated e-puck on a serial line: v1 with either firmware, or v2.

It behaves like the real ones, oddities included:

- one parser, which waits for operands for ever; no watchdog, no echo, no checksum;
- a zero between commands is ignored; after a return that ends no line, the next byte
  begins a line, even if it is a binary command;
- binary replies come once, after the packet's zero; a packet of D, L and P has none;
- while it calibrates it handles no commands, and its receive ring overflows;
- the banner comes at a reset only; a reset forgets everything;
- speeds saturate without a message, while E reports them unsaturated; see
  `motors_and_sensors` for the speeds of the motors;
- E reports what D commanded last, also after S.

It knows C, D, E, K, L, N, O, P, Q, R, S, V, and Asercom `b`, and answers other letters
as unknown. It opens no port and never waits: bytes and times are arguments.

The source code leaves three things open. Here, E reports 0,0 before the first D;
missing operands keep their last value; a full receive ring starts again and so loses
its bytes.

Source: gctronic/e-puck-library, `Asercom.c`, `BTcom.c`, `e_uart1_rx_char.s`;
e-puck2/e-puck2_main-processor, `Asercom2.c`; GCtronic's wiki, "Advanced sercom
protocol".
"""

import re
import struct
from collections import deque
from collections.abc import Generator

from epuck_mj.bridge.fake.builds import Build
from epuck_mj.bridge.fake.motors_and_sensors import Body, Motors, ProximitySensors
from epuck_mj.bridge.fake.talker import Talker
from epuck_mj.bridge.language.replies import wrapped
from epuck_mj.constants import BATTERY_LOW, N_LEDS, RECEIVE_RING

_RING = range(N_LEDS)

BINARY_OPERANDS = {"D": 4, "L": 2, "P": 4}
"""Number of operand bytes of the binary commands with operands."""


class Firmware(Talker):
    """A robot's firmware, from the moment it is switched on.

    Attributes:
        leds: of the ring, then the body's and the front one: 0 is off, 1 on.
    """

    def __init__(self, body: Body, build: Build, now: float) -> None:
        """Switch the robot on, which sends its banner.

        Args:
            body: what it moves and senses with.
            build: which robot it is.
            now: the time [s].
        """
        super().__init__(body)
        self._build = build
        self.reset(now)

    def reset(self, now: float) -> None:
        """Press the robot's reset button at a time [s], never less than before."""
        self.leds: list[int] = [0] * (N_LEDS + 2)
        self._motors = Motors(self._body, self._build.timer)
        self._sensors = ProximitySensors(self._body, self._build.period, now)
        self._now = now
        self._ring: deque[int] = deque()
        self._operands: dict[str, tuple[int, int]] = {}
        self._resetting = False
        greeting = self._build.greeting.format(self._body.selector()).encode()
        # what it says when the calibration under way is over
        self._pending = b""
        if self._build.calibrates:
            self._sensors.calibrate()
            self._pending = greeting
        else:
            self._out += greeting
        self._program = self._run()
        next(self._program)

    def _advance(self, now: float) -> None:
        self._now = now
        self._sensors.advance(now)
        if self._pending and not self._sensors.calibrating:
            self._out += self._pending
            self._pending = b""
            self._serve()

    def _hear(self, data: bytes) -> None:
        for byte in data:
            self._ring.append(byte)
            if len(self._ring) == RECEIVE_RING:
                self._ring.clear()
            self._serve()

    def _serve(self) -> None:
        while self._ring and not self._sensors.calibrating:
            self._program.send(self._ring.popleft())
            if self._resetting:
                self.reset(self._now)

    def _run(self) -> Generator[None, int, None]:
        """The firmware's main loop; it waits for a byte at each `yield`."""
        while True:
            byte = yield
            stray = False
            while byte in b"\r\n":
                stray = True
                byte = yield
            if byte >= 0x80 and not stray:
                yield from self._binary(byte)
            elif byte != 0 or stray:
                line = bytearray([byte])
                while (byte := (yield)) not in b"\r\n":
                    line.append(byte)
                self._ascii(bytes(line))

    def _binary(self, byte: int) -> Generator[None, int, None]:
        out = bytearray()
        while byte:
            letter = chr(-byte & 0xFF)
            operands = bytearray()
            for _ in range(BINARY_OPERANDS.get(letter, 0)):
                operands.append((yield))
            out += self._packed(letter, bytes(operands))
            byte = yield
        self._out += out

    def _packed(self, letter: str, operands: bytes) -> bytes:
        """Carry out a binary command; its part of the reply."""
        match letter:
            case "D":
                self._motors.drive(*struct.unpack("<2h", operands))
            case "P":
                self._motors.count_from(*struct.unpack("<2h", operands))
            case "L":
                self._light(range(operands[0], operands[0] + 1), operands[1])
            case "E":
                return struct.pack("<2h", *self._motors.commanded)
            case "Q":
                return struct.pack("<2h", *self._motors.counters())
            case "N":
                return struct.pack("<8h", *self._sensors.proximity())
            case "O":
                return struct.pack("<8h", *self._sensors.ambient())
        return b""

    def _ascii(self, line: bytes) -> None:
        """Carry out a line in ASCII."""
        letter = chr(line[0])
        if letter == "b" and self._build.tells_battery:
            self._say("b", [int(self._body.battery() >= BATTERY_LOW)])
            return
        match letter.upper():
            case "C":
                self._say("c", [self._body.selector()])
            case "D":
                self._motors.drive(*self._two_operands(line))
                self._say("d")
            case "E":
                self._say("e", self._motors.commanded)
            case "K":
                self._say("k, Starting calibration - Please keep the robot free")
                self._pending = b"k, Calibration finished\r\n"
                self._sensors.calibrate()
            case "L":
                number, value = self._two_operands(line)
                one = 0 <= number < N_LEDS
                self._light(range(number, number + 1) if one else _RING, value)
                self._say("l")
            case "N":
                self._say("n", self._sensors.proximity())
            case "O":
                self._say("o", self._sensors.ambient())
            case "P":
                self._motors.count_from(*self._two_operands(line))
                self._say("p")
            case "Q":
                self._say("q", self._motors.counters())
            case "R":
                if self._build.resets:
                    self._say("r")
                    self._resetting = True
            case "S":
                self._motors.stop()
                self._light(_RING, 0)
                self._say("s")
            case "V":
                for text in self._build.version:
                    self._say(text)
            case _:
                self._say("z,Command not found")

    def _say(self, text: str, values: tuple[int, ...] | list[int] = ()) -> None:
        self._out += ",".join([text, *map(str, values)]).encode() + b"\r\n"

    def _light(self, numbers: range, value: int) -> None:
        """Switch LEDs off (0), on (1) or over (2)."""
        for number in numbers:
            if number < len(self.leds):
                was = self.leds[number]
                self.leds[number] = {0: 0, 1: 1, 2: 1 - was}.get(value, was)

    def _two_operands(self, line: bytes) -> tuple[int, int]:
        """Operands of a line, as C's `sscanf` reads them into 16 bits."""
        letter = chr(line[0]).upper()
        found = re.match(
            rb".,\s*([+-]?\d{1,9})(?:,\s*([+-]?\d{1,9}))?", line, re.DOTALL
        )
        last = self._operands.get(letter, (0, 0))
        texts = found.groups() if found else (None, None)
        left, right = (
            old if text is None else wrapped(int(text))
            for old, text in zip(last, texts, strict=True)
        )
        self._operands[letter] = left, right
        return left, right
