"""Progress on a terminal and without one."""

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

from evolution.run.history import Record
from evolution.run.progress import LINES, TICK, Progress

ROOT = Path(__file__).resolve().parent.parent
BUDGET = 4000


def records() -> list[Record]:
    return [Record(i, 100 * (i + 1), 2.0 * i, 1.0 * i, 0.5, 9, 0.25) for i in range(40)]


def show() -> None:
    with Progress() as progress:
        progress.begin(BUDGET, 0)
        for record in records():
            progress.update(record)


def wait_for_something() -> None:
    """Nothing happens for a while, three times."""
    with Progress() as progress:
        time.sleep(1.5 * TICK)
        progress.begin(BUDGET, 0)
        time.sleep(2.5 * TICK)
        progress.stage("Choosing the champion", 0, 3)
        time.sleep(2.5 * TICK)
        progress.stage("Testing it", 1, 3)


def shown_on_a_terminal(code: str) -> str:
    """What a process with a real terminal of 140 columns writes to stderr."""
    reader, writer = pty.openpty()
    fcntl.ioctl(writer, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 140, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stderr=writer, stdin=subprocess.DEVNULL
    )
    os.close(writer)
    shown = b""
    try:
        while select.select([reader], [], [], 30)[0]:
            try:
                shown += os.read(reader, 4096)
            except OSError:  # the other end is closed
                break
    finally:
        os.close(reader)
        process.kill()
        process.wait(10)
    return shown.decode()


def test_on_wheels_the_robot_is_named(capsys):
    with Progress() as progress:
        progress.begin(200, 0)
        for climbed in (False, True):
            record = Record(0, 100 + 100 * climbed, 2.0, 1.0, 0.5, 9, 0.25, climbed)
            progress.update(record)
    below, above = capsys.readouterr().err.splitlines()
    assert "robot=" not in below
    assert above.endswith(" crash=25% robot=epuck")


def test_a_terminal_gets_a_bar():
    shown = shown_on_a_terminal("from tests import test_progress as t; t.show()")
    last = shown.replace("\r", "\n").strip().splitlines()[-1]
    for figure in ("100%", "4000/4000", "eval/s", "gen=39", "best=78.0", "crash=25%"):
        assert figure in last


def test_the_clock_goes_on_while_nothing_happens():
    shown = shown_on_a_terminal(
        "from tests import test_progress as t; t.wait_for_something()"
    )
    loading, _, shown = shown.partition("0/4000")
    assert loading.count("Loading the simulator [00:00]") >= 2
    evolving, _, choosing = shown.partition("Choosing the champion")
    # the first drawing, and two of the clock at least
    assert evolving.count("0/4000") >= 2
    assert choosing.count("Choosing the champion:") >= 1
    assert "Testing it:  33%" in choosing
    assert "1/3" in choosing


def test_elsewhere_a_few_lines_are_enough(capsys):
    show()
    lines = capsys.readouterr().err.splitlines()
    assert LINES <= len(lines) <= LINES + 1
    assert lines[0].split() == [
        *("100", "of", "4000", "evaluations:"),
        *("gen=0", "best=0.0", "mean=0.0", "crash=25%"),
    ]
