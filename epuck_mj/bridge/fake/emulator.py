"""An emulated e-puck on a line with faults: bytes and times, no I/O."""

from collections.abc import Sequence

import numpy as np

from epuck_mj.bridge.fake.builds import BUILDS
from epuck_mj.bridge.fake.firmware import Firmware
from epuck_mj.bridge.fake.scenarios import GARBAGE_MAX, LOSS, Fault
from epuck_mj.bridge.fake.simulated_body import SimulatedBody
from epuck_mj.bridge.fake.talker import Talker
from epuck_mj.bridge.fake.wifi_firmware import WifiFirmware
from epuck_mj.bridge.fake.wire import Wire
from epuck_mj.constants import BYTE_TIME
from epuck_mj.errors import UserError

WIFI = "wifi"
"""The e-puck2 behind its radio."""

EMULATED_ROBOTS = (*BUILDS, WIFI)
"""The robots that can be emulated."""


class Emulator:
    """Body, firmware, and the wires to it.

    Attributes:
        body: in its scene.
    """

    def __init__(
        self,
        body: SimulatedBody,
        robot: str,
        now: float,
        faults: Sequence[Fault] = (),
        latency: float = 0.0,
        seed: int = 0,
    ) -> None:
        """Switch the robot on.

        Args:
            body: of the robot.
            robot: one of EMULATED_ROBOTS.
            now: the time [s].
            faults: what goes wrong.
            latency: of each way [s], beside the UART's.
            seed: decides which bytes are lost or made.

        Raises:
            UserError: if there is no such robot.
        """
        if robot not in EMULATED_ROBOTS:
            names = ", ".join(EMULATED_ROBOTS)
            raise UserError(f"no robot '{robot}'; available: {names}")
        self.body = body
        self._robot = robot
        self._faults = tuple(faults)
        self._random = np.random.default_rng(seed)
        pace = 0.0 if robot == WIFI else BYTE_TIME
        self._there = Wire(latency, 0.0, 2 * seed, pace)
        self._back = Wire(latency, 0.0, 2 * seed + 1, pace)
        self._begun: float | None = None
        self._done: set[Fault] = set()
        self._firmware = self._switched_on(now)

    @property
    def busy(self) -> bool:
        """Whether bytes are under way."""
        return not (self._there.idle and self._back.idle)

    def connected(self, now: float) -> bool:
        """Whether the robot's port exists at a time [s]."""
        return not self._lasting({"disconnect", "gone"}, now)

    def exchange(self, heard: bytes, now: float) -> bytes:
        """Let time pass; the bytes that reach the host. To be called often.

        Args:
            heard: what the host has sent since the last call.
            now: the time [s], never less than before.
        """
        if self._begun is None and heard:
            self._begun = now
        self.body.advance(now)
        self._befall(now)
        lossy = bool(self._lasting({"loss"}, now))
        self._there.loss = self._back.loss = LOSS if lossy else 0.0
        self._there.send(heard, now)
        connected, stalled = self.connected(now), self._lasting({"stall"}, now)
        if not connected:
            self._there.cut()
        arrived = b"" if stalled else self._there.receive(now)
        n_told = self._firmware.n_told
        self._firmware.feed(arrived, now)
        self._back.send(self._firmware.output(now), now)
        self.body.told(self._firmware.n_told - n_told)
        if not connected:
            self._back.cut()
        return b"" if stalled else self._back.receive(now)

    def _switched_on(self, now: float) -> Talker:
        if self._robot == WIFI:
            return WifiFirmware(self.body, now)
        return Firmware(self.body, BUILDS[self._robot], now)

    def _lasting(self, kinds: set[str], now: float) -> list[Fault]:
        if self._begun is None:
            return []
        time = now - self._begun
        return [f for f in self._faults if f.kind in kinds and f.lasts(time)]

    def _befall(self, now: float) -> None:
        """Carry out the due faults of the kinds that happen once."""
        if self._begun is None:
            return
        for fault in self._faults:
            if now - self._begun < fault.start or fault in self._done:
                continue
            self._done.add(fault)
            match fault.kind:
                case "garbage":
                    self._back.send(self._garbage(), now)
                case "noise":
                    self._there.send(self._garbage(), now)
                case "reset":
                    self._firmware = self._switched_on(now)

    def _garbage(self) -> bytes:
        return self._random.bytes(int(self._random.integers(1, GARBAGE_MAX + 1)))
