"""Emulated robots for a fleet, and the terminal of the person who drives them."""

import contextlib
import os
import pty
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.fake.endpoints import Pty, Tcp
from epuck_mj.bridge.fake.scenarios import scenario
from tests.test_fake import living, wait_for


@contextmanager
def robots(scene, folder: Path, *faults: str, kind="tcp") -> Iterator[dict]:
    """Emulated robots by their ports' names, one for each text of faults."""
    with contextlib.ExitStack() as stack:
        there = {}
        for number, fault in enumerate(faults):
            port = Tcp(0) if kind == "tcp" else Pty(folder / f"e-puck-{number}")
            start = (0.15 * number - 0.3, 0.0, np.pi / 2)
            emulator = stack.enter_context(living(port, scene, start, faults=fault))
            there[port.name] = emulator
        yield there


def befall(emulator: Emulator, fault: str) -> None:
    """Let it happen now, however long the robot had to wait until it drove."""
    assert emulator._begun is not None
    now = time.monotonic() - emulator._begun
    emulator._faults = scenario(fault.format(f"{now:.3f}"))


class Terminal:
    """The person's side of a terminal, which reads all that is shown."""

    def __init__(self):
        self.master, self.slave = pty.openpty()
        self.shown = ""
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        with contextlib.suppress(OSError):
            while data := os.read(self.master, 10_000):
                self.shown += data.decode()

    def press(self, keys: bytes):
        os.write(self.master, keys)

    def close(self):
        for handle in (self.master, self.slave):
            with contextlib.suppress(OSError):
                os.close(handle)


def all_move(there: dict[str, Emulator]) -> bool:
    return not any(emulator.body.standing for emulator in there.values())


def slowest_stop(there: dict[str, Emulator]) -> float:
    """Wait until all robots stand; how long the last one took [s]."""
    began = time.monotonic()
    wait_for(lambda: all(each.body.standing for each in there.values()), "stood")
    return time.monotonic() - began
