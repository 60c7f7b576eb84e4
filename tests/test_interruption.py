"""Signals that come in a finaliser, or while a process is started."""

import os
import signal
import sys
import threading
import time

import pytest

from epuck_mj.host.command_line import main
from epuck_mj.host.interruption import (
    Interrupted,
    Interruption,
    deaf_to_interrupts,
)
from tests.processes import PATIENCE


class Finalised:
    """An object in whose finaliser a signal comes."""

    def __init__(self, signum: signal.Signals):
        self.signum = signum

    def __del__(self):
        signal.raise_signal(self.signum)


def finalise(signum: signal.Signals) -> None:
    Finalised(signum)
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        time.sleep(0.001)
    pytest.fail("nothing was raised again")


def test_a_signal_in_a_finaliser_is_not_lost(handlers, capsys):
    before = sys.unraisablehook
    with (
        Interruption() as interruption,
        pytest.raises(Interrupted),
        interruption.raising(),
    ):
        finalise(signal.SIGTERM)
    assert interruption.signum == signal.SIGTERM
    assert sys.unraisablehook is before
    assert capsys.readouterr() == ("", "")


def test_nor_where_it_comes_too_late_for_the_block(handlers):
    """It is never raised behind it, where motors are stopped."""
    with Interruption() as interruption:
        with interruption.raising():
            Finalised(signal.SIGTERM)
        time.sleep(0.1)
        assert interruption.signum == signal.SIGTERM
        with pytest.raises(Interrupted), interruption.raising():
            pytest.fail("one came before")


def test_ctrl_c_in_a_finaliser_ends_a_command(handlers, capsys):
    def run(argv):
        finalise(signal.SIGINT)
        return 0

    with pytest.raises(SystemExit) as end:
        main(run)
    assert end.value.code == 130
    assert capsys.readouterr() == ("", "")


def test_other_exceptions_of_finalisers_are_shown_as_ever(handlers, monkeypatch):
    class Failing:
        def __del__(self):
            raise ValueError("in a finaliser")

    shown = []
    monkeypatch.setattr(sys, "unraisablehook", shown.append)
    with Interruption() as interruption, interruption.raising():
        Failing()
    assert [type(each.exc_value) for each in shown] == [ValueError]


linux = pytest.mark.skipif(sys.platform != "linux", reason="needs POSIX signals")


@linux
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_a_process_that_is_being_started_is_not_left_half_way(signum, handlers):
    """Neither in this thread nor by way of another one, which does not block it."""
    ended, reached = threading.Event(), False
    other = threading.Thread(target=ended.wait)
    other.start()
    try:
        with (
            Interruption() as interruption,
            pytest.raises(Interrupted),
            interruption.raising(),
        ):
            with deaf_to_interrupts():
                os.kill(os.getpid(), signum)
                time.sleep(0.1)
                reached = True
            pytest.fail("the signal was lost")
    finally:
        ended.set()
        other.join()
    assert reached
    assert interruption.signum == signum
