"""Schedule of control steps, by a monotonic clock."""

import time
from collections.abc import Callable


class Schedule:
    """Ticks at equal intervals.

    A step that is not done when its tick comes is an overrun: the next tick then comes
    a whole period after the late one, so no step is shorter than the others.

    Attributes:
        n_overruns: so far.
    """

    def __init__(
        self,
        period: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """A schedule that has not begun.

        Args:
            period: from tick to tick [s].
            clock: the time [s].
            sleep: waits for a number of seconds.
        """
        self._period = period
        self._clock = clock
        self._sleep = sleep
        self._tick = 0.0
        self.n_overruns = 0

    def begin(self) -> None:
        """The first tick is one period from now."""
        self._tick = self._clock() + self._period

    def wait(self) -> None:
        """Wait until the next tick."""
        left = self._tick - self._clock()
        if left < 0:
            self.n_overruns += 1
            self._tick -= left
        else:
            self._sleep(left)
        self._tick += self._period
