"""Base of the emulated firmwares, which receive and send bytes as time passes."""

from abc import ABC, abstractmethod

from epuck_mj.bridge.fake.motors_and_sensors import Body, ProximitySensors


class Talker(ABC):
    """A firmware on a body; the times it is given never decrease."""

    _sensors: ProximitySensors

    def __init__(self, body: Body) -> None:
        """Start a firmware on a body."""
        self._body = body
        self._out = bytearray()

    @property
    def n_told(self) -> int:
        """How often proximity counts were sent since the start."""
        return self._sensors.n_told

    def feed(self, data: bytes, now: float) -> None:
        """Receive any number of bytes at a time [s]."""
        self._advance(now)
        self._hear(data)

    def output(self, now: float) -> bytes:
        """The bytes sent since the last call, up to a time [s].

        To be called often: time passes only in this call, and sensors are read at the
        first call after their time.
        """
        self._advance(now)
        out = bytes(self._out)
        self._out.clear()
        return out

    @abstractmethod
    def _advance(self, now: float) -> None: ...

    @abstractmethod
    def _hear(self, data: bytes) -> None: ...
