"""The link: one request at a time, in step or not at all, on ports that fail."""

import os
import socket
import threading
import time
import tty

import pytest

from epuck_mj.bridge.failures import BridgeError, LinkLost, NoReply, RobotRestarted
from epuck_mj.bridge.language import ascii, binary
from epuck_mj.bridge.language.protocol import RESYNC
from epuck_mj.bridge.language.replies import Battery, Cycle, Proximity, Steps, Version
from epuck_mj.bridge.line.connect import open_port
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_port import SerialPort, ports
from epuck_mj.errors import UserError

VERSION = b"v,Version 1.2.2 August 2008 GCtronic\r\nHW version: 1.1\r\n"
BANNER = b"\f\aWELCOME to the SerCom protocol on e-Puck\r\n"
BARRIER = VERSION + b"e,0,0\r\n"


CYCLE = binary.echoed_cycle_packet(300, -1, False)
CYCLED = bytes(20) + b"\x2c\x01\xff\xff"


class Script:
    """A port in a time of its own: says things when it has heard enough."""

    def __init__(self, *answers: tuple[float, bytes]):
        self.answers = list(answers)
        self.now = 0.0
        self.heard = b""
        self.due: list[tuple[float, bytes]] = []
        self.gone = False
        self.closed = False

    def clock(self):
        return self.now

    def sleep(self, duration):
        self.now += duration

    def send(self, data):
        if self.gone:
            raise LinkLost("a port", "nothing")
        self.heard += data
        # a flush is no request
        if self.answers and data != RESYNC.flush:
            delay, said = self.answers.pop(0)
            self.due.append((self.now + delay, said))

    def receive(self, timeout):
        if self.gone:
            raise LinkLost("a port", "nothing")
        said = b"".join(text for when, text in self.due if when <= self.now)
        self.due = [entry for entry in self.due if entry[0] > self.now]
        if not said:
            self.now += min(timeout, 0.01)
        return said

    def close(self):
        self.closed = True


def linked(*answers) -> tuple[Link, Script]:
    """A link in step with a script."""
    script = Script(*answers)
    link = Link(lambda: script, script.clock, script.sleep)
    link.flush()
    script.heard = b""
    return link, script


def test_a_reply():
    link, script = linked((0.05, b"b,1\r\n"), (0.0, CYCLED))
    assert link.ask(ascii.battery_query()) == Battery("1")
    assert link.ask(CYCLE) == Cycle(Proximity((0,) * 8), Steps(0, 0))
    assert script.heard == ascii.battery_query().out + CYCLE.out
    assert link.in_step


@pytest.mark.parametrize(
    "request_", [CYCLE, ascii.battery_query()], ids=["binary", "ascii"]
)
@pytest.mark.parametrize("cut", [1, 20, len(BANNER) - 3])
def test_a_banner_in_two_halves_is_a_banner(request_, cut):
    """The first half comes for a reply, the other one while host and robot meet."""
    link, script = linked((0.0, BANNER[:cut]), (0.0, BARRIER))
    with pytest.raises(BridgeError):
        link.ask(request_)
    script.due.append((script.now, BANNER[cut:]))
    assert link.resync(script.now + 5)
    assert link.in_step


@pytest.mark.parametrize(
    ("state", "text"), [("1", "good"), ("0", "low"), ("3210 (87%)", "3210 (87%)")]
)
def test_battery(state, text):
    link, _ = linked((0.0, b"b," + state.encode() + b"\r\n"))
    assert link.ask(ascii.battery_query()) == Battery(state)
    assert str(Battery(state)) == text


def test_a_battery_that_nobody_tells():
    link, _ = linked((0.0, b"z,Command not found\r\n"))
    with pytest.raises(BridgeError, match="not found"):
        link.ask(ascii.battery_query())


def test_no_reply_ends_in_time_and_out_of_step():
    link, script = linked()
    with pytest.raises(NoReply, match=r"b \(battery\) in time; got nothing"):
        link.ask(ascii.battery_query())
    assert script.now == pytest.approx(0.3, abs=0.02)
    assert not link.in_step
    heard = script.heard
    with pytest.raises(BridgeError, match="in step"):
        link.ask(ascii.battery_query())
    assert script.heard == heard


def test_until_is_sooner_than_patience():
    link, script = linked((0.2, b"b,1\r\n"))
    with pytest.raises(NoReply):
        link.ask(ascii.battery_query(), until=0.1)
    assert script.now == pytest.approx(0.1, abs=0.011)


def test_a_lost_byte_is_not_waited_for():
    link, script = linked((0.02, b"\x2c\x01\xff"))
    with pytest.raises(NoReply, match=r"got b',\\x01\\xff'"):
        link.ask(CYCLE)
    assert script.now < 0.1


def test_leftovers_before_ascii_are_dropped_and_before_binary_they_are_not():
    link, script = linked((0.0, b"b,1\r\nhello"), (0.0, b"b,0\r\n"))
    link.ask(ascii.battery_query())
    assert link.ask(ascii.battery_query()) == Battery("0")
    script.due = [(script.now, b"x")]
    heard = script.heard
    with pytest.raises(BridgeError, match="silence before D"):
        link.ask(CYCLE)
    assert script.heard == heard
    assert not link.in_step


def test_a_banner_before_a_request():
    link, script = linked((0.0, b"b,1\r\n"))
    script.due = [(0.0, BANNER)]
    with pytest.raises(RobotRestarted):
        link.ask(ascii.battery_query())
    assert not link.in_step


def test_resync_sends_the_recipe():
    link, script = linked((0.03, BARRIER))
    assert link.resync(5.0) is False
    assert link.in_step
    assert script.heard == RESYNC.flush + RESYNC.barrier.out


def test_resync_drops_what_is_under_way_and_notices_a_reset():
    link, script = linked((0.0, BARRIER))
    script.due = [(0.04, b"n,1,2"), (0.08, BANNER)]
    assert link.resync(5.0) is True
    assert link.in_step


def test_resync_does_not_take_an_older_barrier_for_its_own():
    # the first answer is late and comes with the second: a third is alone
    link, _ = linked((0.45, BARRIER), (0.0, BARRIER), (0.0, BARRIER))
    assert link.resync(5.0) is False
    assert link.in_step


def test_resync_gives_up_in_time():
    link, script = linked()
    with pytest.raises(NoReply, match="an e-puck that answers V; got nothing"):
        link.resync(2.0)
    assert 2.0 <= script.now < 2.1
    assert not link.in_step


def test_resync_with_a_device_that_never_is_silent():
    link, script = linked()
    script.receive = lambda timeout: setattr(script, "now", script.now + 0.01) or b"$GP"
    with pytest.raises(NoReply, match=r"got b'\$GP"):
        link.resync(2.0)
    assert script.now < 2.1


def test_a_lost_port_is_closed_and_opened_again():
    link, script = linked((0.0, BARRIER))
    script.gone = True
    with pytest.raises(LinkLost):
        link.ask(ascii.battery_query())
    assert link.lost
    assert script.closed
    with pytest.raises(LinkLost, match="one that was lost"):
        link.ask(ascii.battery_query())
    script.gone = False
    link.reopen(script.now + 1)
    assert not link.lost
    assert not link.in_step
    link.resync(script.now + 1)


def test_attempts_to_open_a_lost_port_are_bounded():
    script = Script()
    opened = []

    def open_port():
        opened.append(script.now)
        if len(opened) > 1:
            raise UserError("no port 'x'")
        return script

    link = Link(open_port, script.clock, script.sleep)
    with pytest.raises(LinkLost, match="no port 'x'"):
        link.reopen(5.0)
    assert 5.0 <= script.now < 5.2
    assert 40 < len(opened) < 60


# real ports


def test_a_pseudo_terminal():
    master, slave = os.openpty()
    tty.setraw(slave)
    link = Link(lambda: SerialPort(os.ttyname(slave)))
    try:
        link.flush()
        # what was sent before is still in the line
        assert os.read(master, 100) == RESYNC.flush
        answer = threading.Timer(0.05, os.write, (master, b"b,7\r\n"))
        answer.start()
        assert link.ask(ascii.battery_query()) == Battery("7")
        answer.join()
        # a second host
        with pytest.raises(UserError, match="is busy: another program has it"):
            SerialPort(os.ttyname(slave))
        os.close(slave)
        os.close(master)
        master = slave = -1
        with pytest.raises(LinkLost, match="a robot at '/dev/"):
            link.ask(ascii.battery_query())
    finally:
        link.close()
        for handle in (master, slave):
            if handle >= 0:
                os.close(handle)


def test_a_socket():
    with socket.create_server(("127.0.0.1", 0)) as server:
        name = f"socket://127.0.0.1:{server.getsockname()[1]}"
        link = Link(lambda: open_port(name))
        host, _ = server.accept()
        with host:
            host.sendall(BARRIER)
            time.sleep(0.05)
            assert link.drain(time.monotonic() + 1) == BARRIER
        with pytest.raises(LinkLost, match="disconnected"):
            link.drain(time.monotonic() + 1)
        assert link.lost
    with pytest.raises(LinkLost, match="Connection refused"):
        link.reopen(time.monotonic())


def test_a_port_that_is_no_file_has_no_guardian():
    """Such are rfc2217:// and all of Windows: nothing to share."""
    link = Link(lambda: SerialPort("loop://", farewell=b"D,0,0"))
    link.close()


def test_a_port_is_closed_if_no_guardian_can_be_had(monkeypatch):
    closed = []

    def refuse(*_) -> None:
        raise BlockingIOError(11, "no more processes")

    monkeypatch.setattr("epuck_mj.bridge.line.serial_port.guardian.hire", refuse)
    monkeypatch.setattr(SerialPort, "close", lambda port: closed.append(port.name))
    with pytest.raises(UserError, match="no guardian for 'loop://'"):
        SerialPort("loop://", farewell=b"D,0,0")
    assert closed == ["loop://"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("/dev/no-such-port", "^no port '/dev/no-such-port'; available: "),
        ("/dev/null", "^'/dev/null' is not a serial port; --list-ports"),
        ("/", "^'/' is not a serial port; --list-ports"),
        ("", "cannot open port|no port"),
        ("socket://", "^expected socket://host:port with a port from 1 to 65535"),
        ("socket://127.0.0.1:99999", "^expected socket://host:port with a port from 1"),
        ("socket://127.0.0.1:0", "^expected socket://host:port with a port from 1"),
        ("socket://127.0.0.1:-1", "^expected socket://host:port with a port from 1"),
        ("socket://127.0.0.1", "^expected socket://host:port with a port from 1"),
        ("socket://a b:1000", "^expected socket://host:port with a port from 1"),
        ("socket://me@there:1000", "^expected socket://host:port with a port from 1"),
        ("tcp://127.0.0.1:99999", r"^expected tcp://host\[:port\] with a port from 1"),
        ("tcp://127.0.0.1:x", r"^expected tcp://host\[:port\] with a port from 1"),
        ("tcp://127.0.0.1/1000", r"^expected tcp://host\[:port\] with a port from 1"),
        ("tcp://[::1", r"^expected tcp://host\[:port\] with a port from 1"),
        ("tcp://", r"^expected tcp://host\[:port\] with a port from 1"),
        ("tcp://a..b", "^cannot open port 'tcp://a..b': "),
        ("socket://127.0.0.1:1", "Connection refused"),
        ("nonsense://x", "invalid URL"),
        ("a\0b", "cannot open port"),
    ],
)
def test_ports_that_cannot_be_opened(name, message):
    with pytest.raises(UserError, match=message) as caught:
        open_port(name)
    assert "\n" not in str(caught.value)


def test_permission_denied(tmp_path, monkeypatch):
    import serial

    def refuse(*_, **__):
        raise serial.SerialException(13, "could not open port x: Permission denied")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(UserError, match=r"^permission denied for port '/dev/rfcomm0'"):
        SerialPort("/dev/rfcomm0")


def test_list_of_ports():
    assert all(len(entry) == 2 and all(entry) for entry in ports())


def test_version_of_a_script():
    link, _ = linked((0.0, BARRIER))
    expected = Version(("Version 1.2.2 August 2008 GCtronic", "HW version: 1.1"))
    assert link.ask(ascii.version_query()) == expected
