"""The wire between a host and its robot: a UART's pace, latency, lost bytes."""

from collections import deque

import numpy as np

from epuck_mj.constants import BYTE_TIME


class Wire:
    """One direction of a serial line, which keeps bytes in order.

    Attributes:
        loss: probability that a byte is lost; may be changed.
    """

    def __init__(
        self, latency: float, loss: float, seed: int, byte_time: float = BYTE_TIME
    ) -> None:
        """Start with an idle line.

        Args:
            latency: added to the time that a byte takes on the UART [s].
            loss: probability that a byte is lost.
            seed: decides which ones.
            byte_time: that a byte takes [s].
        """
        self._latency = latency
        self._byte_time = byte_time
        self.loss = loss
        self._random = np.random.default_rng(seed)
        self._free = 0.0
        self._under_way: deque[tuple[float, int]] = deque()

    @property
    def idle(self) -> bool:
        """Whether nothing is under way."""
        return not self._under_way

    def cut(self) -> None:
        """Lose what is under way."""
        self._under_way.clear()

    def send(self, data: bytes, now: float) -> None:
        """Put bytes on the line.

        Args:
            data: any number of bytes.
            now: the time [s], never less than before.
        """
        for byte in data:
            self._free = max(self._free, now) + self._byte_time
            if self._random.random() >= self.loss:
                self._under_way.append((self._free + self._latency, byte))

    def receive(self, now: float) -> bytes:
        """The bytes that have arrived at a time [s], never less than before."""
        arrived = bytearray()
        while self._under_way and self._under_way[0][0] <= now:
            arrived.append(self._under_way.popleft()[1])
        return bytes(arrived)
