"""The bridge against robots that go wrong: wheels stand soon, and it ends soon.

Sessions are in threads of this process; a few bridges are processes of their own, as
all are in `python -m tests.meet_hostile_peers`.
"""

import os
import pty
import signal
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from epuck_mj.bridge.__main__ import bridge
from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Session
from epuck_mj.bridge.failures import BridgeError, StillMoving
from epuck_mj.bridge.line.connect import connect
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import TaskParameters
from tests.hostile_peers import LINKS, PEERS, Hostile
from tests.meet_hostile_peers import ENDS, STANDS
from tests.no_pictures import BRIDGE
from tests.processes import PATIENCE, python_process
from tests.test_fake import wait_for

AT_ONCE = {False: 12, True: 2}
"""Peers at once: those that flood keep a processor busy."""

LEAVES = 5.0
"""Longest time that a process on a busy machine takes to leave after its drive [s]."""


def session(port: str) -> BridgeError | None:
    """What ends a drive without end."""
    robot = RealRobot(connect(port), Calibration(), 0.1)
    record = Session(TaskParameters())
    try:
        with robot:
            robot.greet()
            for _ in record.drive(robot, WallFollower(), 10**6, time.monotonic):
                pass
    except BridgeError as error:
        return error
    return None


def complaint(name: str, link: str, folder: Path, drives: float) -> str:
    """What the bridge did wrong with a peer, if anything."""
    peer = PEERS[name]
    with Hostile(peer, link, folder, drives) as hostile:
        error = session(hostile.name_of_port)
        ended = time.monotonic()
    if hostile.fault is None or not isinstance(error, BridgeError):
        return f"{name}: ended by {error}, fault at {hostile.fault}"
    # this machine may be busy
    ends, spare = ended - hostile.fault, hostile.lateness
    if ends > ENDS + spare:
        return f"{name}: ended after {ends:.2f} s ({spare:.2f}): {error}"
    stood = hostile.stood()
    if drives < 0:
        return f"{name}: drove" if hostile.driving else ""
    if stood is None:
        # nobody was there to be told
        gone = peer.hangs_up and not peer.returns and isinstance(error, StillMoving)
        return "" if gone else f"{name}: drives on: {error}"
    if stood - hostile.fault > STANDS + spare:
        return f"{name}: stood after {stood - hostile.fault:.2f} s ({spare:.2f})"
    return ""


def complaints(
    link: str, folder: Path, drives: float, but: tuple[str, ...] = ()
) -> list[str]:
    """What the bridge did wrong with each peer on a link."""
    found = []
    for floods, at_once in AT_ONCE.items():
        names = [
            name
            for name, peer in PEERS.items()
            if link in peer.links and name not in but and peer.floods == floods
        ]
        with ThreadPoolExecutor(at_once) as pool:
            said = list(
                pool.map(lambda name: complaint(name, link, folder, drives), names)
            )
        # once more, alone: a busy machine looks like a slow bridge
        suspects = [name for name, text in zip(names, said, strict=True) if text]
        found += [complaint(name, link, folder, drives) for name in suspects]
    return [text for text in found if text]


@pytest.mark.slow
@pytest.mark.parametrize("link", LINKS)
def test_peers_that_go_wrong_while_they_drive(link, tmp_path):
    assert complaints(link, tmp_path, drives=0.2) == []


@pytest.mark.slow
@pytest.mark.parametrize("link", LINKS)
def test_peers_that_are_wrong_from_the_beginning(link, tmp_path):
    # who says nothing may be about to start, and is given CONNECT_TIME_MAX; packets
    # that always were late look like others
    patient = ("silence", "deaf", *(["late answers"] if link == "wifi" else []))
    assert complaints(link, tmp_path, drives=-1, but=patient) == []


# signals


def arguments(port: str, folder: Path) -> list[str]:
    """Of a bridge."""
    return ["wall-follower", "--port", port, "--log", str(folder / "log")]


@pytest.mark.slow
def test_a_signal_while_a_peer_floods(tmp_path):
    with (
        Hostile(PEERS["flood of readings"], "wifi", tmp_path, 0.2) as hostile,
        python_process(
            *("-W", "error", "-c", BRIDGE),
            *arguments(hostile.name_of_port, tmp_path),
        ) as process,
    ):
        wait_for(lambda: hostile.fault is not None, "went wrong")
        asked = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=PATIENCE)
        ended = time.monotonic()
    stood = hostile.stood()
    assert stood is not None
    assert stood - asked < STANDS + hostile.lateness
    assert ended - asked < ENDS + LEAVES + hostile.lateness
    # 4 if its counters do not say in time that it stands, which they may in the flood
    assert process.returncode in (4, 130)
    assert error.count("\n") <= 1


@pytest.mark.slow
@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("name", ["silence", "slow banner"])
def test_a_signal_while_nobody_is_met(name, tmp_path, capfd):
    with Hostile(PEERS[name], "pty", tmp_path, -1) as hostile:

        def interrupt():
            wait_for(lambda: hostile.met is not None, "heard anything")
            os.kill(os.getpid(), signal.SIGTERM)

        threading.Thread(target=interrupt).start()
        status = bridge(arguments(hostile.name_of_port, tmp_path))
        assert hostile.met is not None
        assert time.monotonic() - hostile.met < ENDS + hostile.lateness
    assert status == 128 + signal.SIGTERM
    assert capfd.readouterr().err == "SIGTERM: ended, never began\n"


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("what", ["getaddrinfo", "create_connection"])
def test_a_signal_while_it_connects(what, tmp_path, monkeypatch, capfd):
    """A name server, or a robot, that does not answer."""
    answered = threading.Event()
    asked = []

    def unanswered(*_, **__):
        asked.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGHUP)
        answered.wait(PATIENCE)
        raise OSError("too late")

    monkeypatch.setattr(socket, what, unanswered)
    try:
        assert bridge(arguments("tcp://robot", tmp_path)) == 128 + signal.SIGHUP
        assert time.monotonic() - asked[0] < ENDS
    finally:
        answered.set()
    assert capfd.readouterr().err == "SIGHUP: ended, never began\n"


@pytest.mark.slow
def test_a_terminal_that_is_stopped(tmp_path):
    """Ctrl-S: nothing is written any more, but the robot is driven, and stopped."""
    master, slave = pty.openpty()
    try:
        with (
            Hostile(PEERS["silence"], "pty", tmp_path, PATIENCE) as hostile,
            python_process(
                *("-W", "error", "-c", BRIDGE),
                *arguments(hostile.name_of_port, tmp_path),
                stdin=slave,
                stdout=slave,
                stderr=slave,
            ) as process,
        ):
            wait_for(lambda: hostile.driving, "drove")
            os.write(master, b"\x13")
            time.sleep(0.5)
            assert hostile.driving
            asked = time.monotonic()
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE)
            assert time.monotonic() - asked < ENDS + LEAVES + hostile.lateness
            assert not hostile.driving
    finally:
        os.close(master)
        os.close(slave)
    assert process.returncode == 128 + signal.SIGTERM
