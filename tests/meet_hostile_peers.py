"""Bridges meet robots that go wrong, each as a process of its own, one at a time.

`python -m tests.meet_hostile_peers` prints a Markdown table, in about ten minutes on an
idle machine; `... "slow banner" echo` is about those only. The exit status is 1 if a
limit is missed.
"""

import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.hostile_peers import CASES, PEERS, Hostile
from tests.processes import PATIENCE, python_process

STANDS = 0.5
"""Longest time from a fault to wheels that are told to stand [s]."""

ENDS = 2.0
"""Longest time from a fault, or a signal, to the end of a drive [s]."""

PICTURES = 5.0
"""Longest time that a process then takes for the pictures of its log [s].

It loads rerun and matplotlib; the robot stands, and its port is free.
"""

DRIVES = 0.5
"""How long a robot is in order and drives [s]."""

TITLES = ("peer", "link", "stands [s]", "ends [s]", "ends after SIGINT [s]")
TITLES += ("machine late [s]", "says")


@dataclass(frozen=True)
class Meeting:
    """What a bridge did.

    Attributes:
        stood: when it told the wheels to stand, after the fault [s]; None if never.
        ended: when it ended, after the fault or the signal [s].
        last: what it said last.
        gone: whether there was nobody to tell to stand.
        late: longest time that the peer waited for its turn on this machine [s].
    """

    stood: float | None
    ended: float
    last: str
    gone: bool
    late: float

    @property
    def sound(self) -> bool:
        """Whether it keeps the limits."""
        stands = self.gone if self.stood is None else self.stood <= STANDS
        return stands and self.ended <= ENDS + PICTURES


class NeverDrove(Exception):
    """A bridge ended before its peer went wrong: this machine was busy."""


def meet(name: str, link: str, interrupt: bool) -> Meeting:
    """Let a bridge drive a robot that goes wrong.

    Args:
        name: of the peer.
        link: one of its links.
        interrupt: whether SIGINT comes with the fault.

    Raises:
        NeverDrove: if the bridge ends before the fault.
    """
    peer = PEERS[name]
    with (
        tempfile.TemporaryDirectory() as folder,
        Hostile(peer, link, Path(folder), DRIVES) as hostile,
        python_process(
            *("-W", "error", "-m", "epuck_mj.bridge", "wall-follower"),
            *("--port", hostile.name_of_port, "--log", f"{folder}/log"),
        ) as process,
    ):
        began = time.monotonic()
        while hostile.fault is None:
            if process.poll() is not None:
                raise NeverDrove(process.communicate()[1].strip())
            assert time.monotonic() < began + PATIENCE, "it never drove"
            time.sleep(0.001)
        asked = hostile.fault
        if interrupt:
            asked = time.monotonic()
            process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=PATIENCE)
        ended = time.monotonic()
    stood = hostile.stood()
    said = (stderr.strip() or stdout.strip()).splitlines() or ["nothing"]
    return Meeting(
        stood=None if stood is None else stood - hostile.fault,
        ended=ended - asked,
        last=f"{said[-1]} ({process.returncode})",
        gone=peer.hangs_up and not peer.returns,
        late=hostile.lateness,
    )


def _met(name: str, link: str, interrupt: bool) -> Meeting:
    """See `meet`; tried again, twice at the most."""
    for _ in range(2):
        try:
            return meet(name, link, interrupt)
        except NeverDrove as problem:
            print(f"{name} on {link}: again, {problem}", file=sys.stderr)
    return meet(name, link, interrupt)


def row(name: str, link: str) -> tuple[str, bool]:
    """A peer's line of the table, and whether the bridge keeps all limits."""
    fault, asked = (_met(name, link, interrupt) for interrupt in (False, True))
    stood = "nobody there" if fault.stood is None and fault.gone else "NEVER"
    if fault.stood is not None:
        stood = f"{fault.stood:.2f}"
    times = (fault.ended, asked.ended, max(fault.late, asked.late))
    cells = [name, link, stood, *(f"{time:.2f}" for time in times), fault.last]
    return f"| {' | '.join(cells)} |", fault.sound and asked.sound


def main(argv: Sequence[str]) -> int:
    """Meet the peers of these names, or all; the exit status."""
    unknown = set(argv) - set(PEERS)
    if unknown:
        print(f"unknown peer {unknown}; available: {', '.join(PEERS)}", file=sys.stderr)
        return 2
    print(f"| {' | '.join(TITLES)} |\n|{'---|' * len(TITLES)}")
    missed = []
    for name, link in CASES:
        if not argv or name in argv:
            line, sound = row(name, link)
            print(line, flush=True)
            missed += [] if sound else [f"{name} on {link}"]
    print(f"\nLimits missed: {', '.join(missed) or 'none'}.")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
