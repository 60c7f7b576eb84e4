"""The emulated e-puck: its quirks one by one, and the host's language against it."""

import struct
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_mj.bridge.failures import BridgeError, RobotRestarted
from epuck_mj.bridge.fake.builds import BUILDS
from epuck_mj.bridge.fake.firmware import Firmware
from epuck_mj.bridge.fake.motors_and_sensors import MotorTimer, Wheel
from epuck_mj.bridge.fake.wifi_firmware import WifiFirmware
from epuck_mj.bridge.fake.wire import Wire
from epuck_mj.bridge.language import ascii, binary, packets
from epuck_mj.bridge.language.packets import PacketParser
from epuck_mj.bridge.language.protocol import RESYNC, greets
from epuck_mj.bridge.language.replies import (
    Acknowledged,
    Cycle,
    Proximity,
    Sensors,
    Steps,
    Version,
)
from epuck_mj.constants import BYTE_TIME, CALIBRATION_SAMPLES, PROXIMITY_PERIOD
from tests.test_protocol import pieces

quick = settings(deadline=None, max_examples=40)

COUNTS = (3000, 700, 90, 20, 15, 16, 0, 4095)
LIGHT = (4000, 3999, 3998, 3997, 3996, 3995, 3994, 3993)
V1 = ["asercom", "btcom"]


class Puck:
    """A body that turns its wheels exactly, on a clock of its own."""

    def __init__(self):
        self.wheels = [Wheel(0.0, 0.0), Wheel(0.0, 0.0)]
        self.pauses = [0.0, 0.0]
        self.turned = [0.0, 0.0]
        self.counts: tuple[int, ...] = COUNTS
        self.position = 3
        self.volts = 3.7

    def run(self, duration: float) -> None:
        for i, wheel in enumerate(self.wheels):
            held = min(self.pauses[i], duration)
            self.pauses[i] -= held
            self.turned[i] += wheel.rate * (duration - held)

    def drive(self, left, right):
        self.wheels = [left, right]
        self.pauses = [left.pause, right.pause]

    def steps(self):
        return round(self.turned[0]), round(self.turned[1])

    def proximity(self):
        return np.array(self.counts)

    def ambient(self):
        return np.array(LIGHT)

    def selector(self):
        return self.position

    def battery(self):
        return self.volts


class Robot:
    """Firmware and body on one clock, awake and its banner read."""

    def __init__(self, build="asercom"):
        self.body = Puck()
        self.now = 0.0
        self.firmware = Firmware(self.body, BUILDS[build], self.now)
        self.wait(2.0)

    def wait(self, duration, n_looks=200) -> bytes:
        out = b""
        for _ in range(n_looks):
            self.body.run(duration / n_looks)
            self.now += duration / n_looks
            out += self.firmware.output(self.now)
        return out

    def hear(self, data: bytes) -> bytes:
        self.firmware.feed(data, self.now)
        return self.firmware.output(self.now)


def ask(robot: Robot, request, cuts: Sequence[int] = ()):
    """The reply to a request, fed in pieces; None if its patience ran out."""
    parser = request.parser()
    came = robot.hear(request.out)
    for piece in pieces(came, cuts):
        reply = parser.feed(piece)
        if reply is not None:
            return reply
    for _ in range(50):
        reply = parser.feed(robot.wait(request.patience / 50, 1))
        if reply is not None:
            return reply
    return None


def resync(robot: Robot, n_tries=3) -> bool:
    for _ in range(n_tries):
        robot.hear(RESYNC.flush)
        while robot.wait(RESYNC.quiet):
            pass
        try:
            if ask(robot, RESYNC.barrier) is not None:
                return True
        except BridgeError:
            pass
    return False


@pytest.fixture(params=BUILDS)
def build(request):
    return request.param


# what is said, byte by byte

ANSWERS = {
    "N": (b"N\r", b"n,3000,700,90,20,15,16,0,4095\r\n"),
    "O": (b"O\r", b"o,4000,3999,3998,3997,3996,3995,3994,3993\r\n"),
    "newline": (b"E\n", b"e,0,0\r\n"),
    "lower case": (b"n\r", b"n,3000,700,90,20,15,16,0,4095\r\n"),
    "Q": (b"Q\r", b"q,0,0\r\n"),
    "P, Q": (b"P,-5,7\rQ\r", b"p\r\nq,-5,7\r\n"),
    "D, E": (b"D,300,-2000\rE\r", b"d\r\ne,300,-2000\r\n"),
    "D in 16 bits": (b"D,65535,32768\rE\r", b"d\r\ne,-1,-32768\r\n"),
    "D without its end": (b"D,1,2\rD,3\rE\r", b"d\r\nd\r\ne,3,2\r\n"),
    "S": (b"D,1,2\rS\rE\r", b"d\r\ns\r\ne,1,2\r\n"),
    "L": (b"L,0,1\r", b"l\r\n"),
    "C": (b"C\r", b"c,3\r\n"),
    "V": (b"V\r", b"v,Version 1.2.2 August 2008 GCtronic\r\nHW version: 1.1\r\n"),
    "b": (b"b\r", b"b,1\r\n"),
    "unknown": (b"?\r", b"z,Command not found\r\n"),
    "no line": (b"N", b""),
    "returns": (b"\r\n\r\n", b""),
    "zeros": (bytes(30), b""),
    "zeros before a line": (bytes(30) + b"E\r", b"e,0,0\r\n"),
    "zeros before a packet": (bytes(30) + b"\xbb\0", bytes(4)),
    "binary N": (b"\xb2\0", struct.pack("<8h", *COUNTS)),
    "binary O": (b"\xb1\0", struct.pack("<8h", *LIGHT)),
    "binary E": (b"\xbc\x2c\x01\xff\xff\xbb\0", b"\x2c\x01\xff\xff"),
    "binary P Q": (b"\xb0\x2c\x01\xff\xff\xaf\0", b"\x2c\x01\xff\xff"),
    "binary D alone": (b"\xbc\x2c\x01\xff\xff\0", b""),
    "binary, no zero yet": (b"\xb2\xaf\xbb", b""),
    "binary, all at once": (
        b"\xb2\xaf\xb2\0",
        struct.pack("<8h2h8h", *COUNTS, 0, 0, *COUNTS),
    ),
    "cycle": (
        b"\xbc\x00\x00\x00\x00\xb2\xaf\0",
        struct.pack("<8h2h", *COUNTS, 0, 0),
    ),
    # hazard 3 of the datasheet: the packet is taken for a line
    "binary after a stray return": (b"E\r\n\xb2\0", b"e,0,0\r\n"),
    "its line": (b"E\r\n\xb2\0\r", b"e,0,0\r\nz,Command not found\r\n"),
}


@pytest.mark.parametrize(
    ("heard", "said"), [pytest.param(*case, id=name) for name, case in ANSWERS.items()]
)
@given(cuts=st.lists(st.integers(0, 40), max_size=5))
@quick
def test_answers(heard, said, cuts):
    robot = Robot()
    assert b"".join(map(robot.hear, pieces(heard, cuts))) == said
    assert robot.wait(1.0) == b""


@pytest.mark.parametrize(
    ("build", "said"),
    [
        ("asercom", b"v,Version 1.2.2 August 2008 GCtronic\r\nHW version: 1.1\r\n"),
        ("btcom", b"v,Version 2.0.0 January 2008\r\n"),
        ("epuck2", b"v,Version 2.0 January 2018 GCtronic\r\nHW version: 1.3\r\n"),
    ],
)
def test_version(build, said):
    assert Robot(build).hear(b"V\r") == said


def test_a_low_battery():
    robot = Robot()
    robot.body.volts = 3.39
    assert robot.hear(b"b\r") == b"b,0\r\n"
    assert Robot("btcom").hear(b"b\r") == b"z,Command not found\r\n"


# quirks


def test_the_parser_waits_for_operands_for_ever():
    robot = Robot()
    assert robot.hear(b"\xbc\x2c\x01") == b""
    assert robot.wait(1000.0) == b""
    # a version's four bytes become operands and what follows
    assert robot.hear(b"V\rE\r") == b""
    assert robot.hear(b"\0") == b""
    assert resync(robot)
    assert robot.hear(b"E\r") == b"e,300,3414\r\n"


def test_a_banner_at_a_reset_only():
    body = Puck()
    robot = Firmware(body, BUILDS["asercom"], 0.0)
    banner = robot.output(0.0)
    assert banner.startswith(b"Selector pos 3\r\n\x0c\x07WELCOME to the SerCom")
    assert banner.endswith(b"\r\n")
    assert robot.output(100.0) == b""
    robot.reset(200.0)
    assert robot.output(200.0) == banner


def test_a_reset_forgets():
    robot = Robot()
    robot.hear(b"D,300,300\rL,8,1\rK\r")
    robot.wait(2.0)
    assert robot.hear(b"N\r") == b"n,0,0,0,0,0,0,0,0\r\n"
    said = robot.hear(b"R\r")
    assert said.startswith(b"r\r\nSelector pos 3\r\n")
    assert greets(said)
    assert robot.body.wheels == [Wheel(0.0, 0.0)] * 2
    assert robot.firmware.leds == [0] * 10
    assert robot.hear(b"Q\rE\r") == b"q,0,0\r\ne,0,0\r\n"
    assert robot.hear(b"N\r") == ANSWERS["N"][1]


def test_btcom_calibrates_before_its_banner():
    robot = Firmware(Puck(), BUILDS["btcom"], 0.0)
    robot.feed(b"N\r", 0.1)
    assert robot.output(1.5) == b""
    said = robot.output(1.7)
    assert said.startswith(b"\x0c\x07WELCOME")
    assert said.endswith(b"n,0,0,0,0,0,0,0,0\r\n")


def test_an_epuck2_does_not_reset():
    robot = Robot("epuck2")
    robot.hear(b"D,300,300\r")
    assert robot.hear(b"R\r") == b""
    assert robot.hear(b"E\r") == b"e,300,300\r\n"


def test_no_watchdog(build):
    robot = Robot(build)
    robot.hear(b"D,100,-100\r")
    robot.wait(60.0)
    assert robot.body.steps() == (6000, -6000)


def test_calibration():
    robot = Robot()
    robot.hear(b"D,100,100\r")
    said = robot.hear(b"K\r")
    assert said.startswith(b"k, Starting calibration - ")
    # half of the time something is nearer
    duration = CALIBRATION_SAMPLES * PROXIMITY_PERIOD
    assert robot.wait(duration / 2) == b""
    robot.body.counts = tuple(max(0, count - 10) for count in COUNTS)
    # nobody is served meanwhile, and the motors go on
    assert robot.hear(b"N\r") == b""
    said = robot.wait(duration)
    assert said.startswith(b"k, Calibration finished\r\nn,0,")
    assert robot.body.turned[0] == pytest.approx(150 * duration, rel=0.01)
    # the mean of what was seen; never negative
    robot.body.counts = COUNTS
    robot.wait(0.1)
    assert robot.hear(b"N\r") == b"n,5,5,5,5,5,5,0,5\r\n"
    assert robot.hear(b"O\r") == ANSWERS["O"][1]


def test_calibrations_do_not_add_up():
    robot = Robot()
    for _ in range(2):
        robot.body.counts = (10,) * 8
        robot.hear(b"K\r")
        # nobody looks before it is long over
        robot.wait(5.0, n_looks=1)
        robot.body.counts = (15,) * 8
        robot.wait(0.1)
        assert robot.hear(b"N\r") == b"n,5,5,5,5,5,5,5,5\r\n"


def test_the_receive_ring_overflows_while_it_calibrates():
    robot = Robot()
    robot.hear(b"K\r")
    robot.hear(b"Q\r" * 31)
    assert robot.wait(3.0).count(b"q,0,0") == 31
    robot.hear(b"K\r")
    robot.hear(b"Q\r" * 33)
    assert robot.wait(3.0).count(b"q,0,0") == 1


def test_sensors_are_read_periodically():
    robot = Robot()
    before = robot.hear(b"N\r")
    robot.body.counts = (0,) * 8
    assert robot.hear(b"N\r") == before
    robot.wait(PROXIMITY_PERIOD)
    assert robot.hear(b"N\r") == b"n,0,0,0,0,0,0,0,0\r\n"


@pytest.mark.parametrize("counter", [2**15 - 1, 2**15, 2**16 + 5, -(2**15) - 1])
def test_counters_wrap(counter):
    robot = Robot()
    robot.body.turned = [float(counter), 0.0]
    wrapped = struct.unpack("<h", struct.pack("<I", counter % 2**32)[:2])[0]
    assert robot.hear(b"Q\r") == f"q,{wrapped},0\r\n".encode()
    assert robot.hear(b"\xaf\0") == struct.pack("<2h", wrapped, 0)


def test_leds():
    robot = Robot()
    robot.hear(b"L,2,1\rL,3,2\rL,3,2\r")
    assert robot.firmware.leds == [0, 0, 1, 0, 0, 0, 0, 0, 0, 0]
    robot.hear(b"L,9,2\r" + b"\xb4\x08\x01\xb4\x09\x01\xb4\x0a\x01\0")
    assert robot.firmware.leds == [1, 1, 0, 1, 1, 1, 1, 1, 1, 1]
    robot.hear(b"S\r")
    assert robot.firmware.leds == [0] * 8 + [1, 1]


# motors

RATES = {
    300: 303,
    350: 357,
    450: 455,
    501: 526,
    526: 526,
    527: 556,
    555: 556,
    600: 625,
    650: 667,
    700: 714,
    750: 769,
    800: 833,
    850: 909,
    910: 1000,
    1000: 1000,
    5000: 1000,
    1: 1,
    0: 0,
}
"""Commanded and real speed of an e-puck v1 [steps/s]: section 2 of the datasheet."""


@pytest.mark.parametrize(("speed", "real"), RATES.items())
@pytest.mark.parametrize("sign", [1, -1])
def test_real_rates(speed, real, sign):
    robot = Robot()
    robot.hear(f"D,{sign * speed},0\r".encode())
    assert robot.body.wheels[0].rate == pytest.approx(sign * real, abs=0.5)
    assert robot.body.wheels[1] == Wheel(0.0, 0.0)


@pytest.mark.parametrize("build", BUILDS)
@given(speed=st.integers(-(2**15), 2**15 - 1))
@quick
def test_never_slower_than_told(build, speed):
    timer = BUILDS[build].timer
    rate = timer.wheel(speed, 0).rate
    told = min(abs(speed), timer.speed_max)
    assert told <= abs(rate) <= told * (1.02 if build == "epuck2" else 1.1)
    assert rate == 0 or (rate > 0) == (speed > 0)


RESENT = [
    (speed, period, change)
    for speed, changes in {
        100: (-2.6, -3.9, -5.1, -13),
        300: (-4.9, -7.7, -9.9, -25),
        500: (-3.7, -5.9, -7.6, -19),
        601: (0, 0, 0, 0),
        1000: (0, 0, 0, 0),
    }.items()
    for period, change in zip((0.1, 0.064, 0.05, 0.02), changes, strict=True)
]
"""D sent again and again: what it costs [steps/s]; section 2 of the datasheet."""


@pytest.mark.parametrize(("speed", "period", "change"), RESENT)
def test_resent_speeds_slow_the_wheels(speed, period, change):
    robot = Robot()
    robot.hear(f"D,{speed},{speed}\r".encode())
    undisturbed = robot.body.wheels[0].rate
    for _ in range(200):
        robot.body.run(period)
        robot.hear(f"D,{speed},{speed}\r".encode())
    mean = robot.body.turned[0] / (200 * period)
    assert mean - undisturbed == pytest.approx(change, rel=0.05)


def test_only_slow_motors_that_turn_are_slowed():
    timer = BUILDS["asercom"].timer
    assert timer.wheel(300, 0).pause == 0
    assert timer.wheel(300, 900).pause == 0
    assert timer.wheel(900, 300).pause == 0
    assert timer.wheel(300, 100).pause > 0
    assert MotorTimer(1000, 10_000, saves_current=False).wheel(300, 300).pause == 0


# the host's language against it

cuts = st.lists(st.integers(0, 2**10), max_size=5)

SAME = [
    (ascii.stop_order(), Acknowledged()),
    (
        binary.echoed_cycle_packet(0, 0, True),
        Cycle(Proximity(COUNTS), Steps(1234, -4321)),
    ),
    (
        binary.echoed_cycle_packet(0, 0, False),
        Cycle(Proximity(COUNTS), Steps(1234, -4321)),
    ),
]
"""Requests that leave a robot standing, and what it answers."""

asked = st.sampled_from(SAME)


def standing(build) -> Robot:
    """A robot, not calibrated, whose sensors and counters don't change."""
    robot = Robot(build)
    if build == "btcom":
        robot.body.counts = tuple(2 * count for count in COUNTS)
    robot.body.turned = [1234.0, -4321.0]
    robot.wait(0.1)
    return robot


@pytest.mark.parametrize("build", BUILDS)
@given(sequence=st.lists(st.tuples(asked, cuts), max_size=6))
@quick
def test_every_request_is_answered(build, sequence):
    robot = standing(build)
    for (request, reply), cut in sequence:
        assert ask(robot, request, cut) == reply
    assert robot.wait(0.1) == b""


def test_requests_that_change_something(build):
    robot = Robot(build)
    lines = tuple(BUILDS[build].version)
    expected = Version((lines[0].removeprefix("v,"), *lines[1:]))
    assert ask(robot, ascii.version_query()) == expected
    assert ask(robot, ascii.calibration_order()) == Acknowledged()
    cycle = ask(robot, binary.echoed_cycle_packet(-1000, 1000, True))
    assert cycle == Cycle(Proximity((0,) * 8), Steps(0, 0))
    robot.wait(1.0)
    cycle = ask(robot, binary.echoed_cycle_packet(300, 301, True))
    assert cycle == Cycle(Proximity((0,) * 8), Steps(-1000, 1000))
    assert robot.hear(b"E\r") == b"e,300,301\r\n"
    assert ask(robot, ascii.stop_order()) == Acknowledged()
    assert robot.hear(b"E\r") == b"e,300,301\r\n"


@given(
    build=st.sampled_from(list(BUILDS)),
    before=st.binary(max_size=40),
    after=st.binary(max_size=40),
    case=asked,
)
@settings(deadline=None, max_examples=120)
def test_garbage_on_the_way_to_the_host(build, before, after, case):
    request, reply = case
    robot = standing(build)
    said = robot.hear(request.out)
    parser = request.parser()
    try:
        found = parser.feed(before + said + after)
    except BridgeError:
        return
    if request.out.endswith(b"\r"):
        assert found is None or found == reply
    elif not before and not after:
        assert found == reply
    else:
        # as long as a reply: a whole one can only be missing, or the garbage's
        assert found is None or len(before + said + after) == len(said)


junk = st.lists(
    st.one_of(
        st.binary(max_size=8),
        st.sampled_from([b"D,900,900", b"\r", b"K\r", b"R\r", b"V\r", b"\xbc\x2c"]),
        st.sampled_from([request.out[:-1] for request, _ in SAME]),
    ),
    max_size=5,
).map(b"".join)


@given(build=st.sampled_from(list(BUILDS)), heard=junk)
@settings(deadline=None, max_examples=80)
def test_resync_after_anything_the_robot_heard(build, heard):
    robot = standing(build)
    robot.hear(heard)
    # each K or reset in it may cost seconds
    assert resync(robot, n_tries=60)
    assert robot.wait(0.3) == b""
    robot.hear(b"P,11,-12\r")
    cycle = ask(robot, binary.echoed_cycle_packet(0, 0, True))
    assert isinstance(cycle, Cycle)
    assert cycle.steps == Steps(11, -12)
    assert robot.hear(b"E\r") == b"e,0,0\r\n"


@given(build=st.sampled_from(V1), case=asked, cut=st.integers(0, 60))
@settings(deadline=None, max_examples=120)
def test_a_reset_in_the_middle_of_a_reply(build, case, cut):
    request, reply = case
    robot = standing(build)
    said = robot.hear(request.out)
    cut %= len(said) + 1
    robot.firmware.reset(robot.now)
    parser = request.parser()
    # the reply breaks off, the banner comes, everything in one piece
    came = said[:cut] + robot.wait(2.0)
    try:
        found = parser.feed(came)
    except RobotRestarted:
        return
    except BridgeError:
        assert greets(came)
        return
    assert cut == len(said)
    assert found == reply
    assert greets(parser.rest)


def test_a_robot_that_was_reset_is_found_out_by_its_speeds():
    robot = Robot()
    assert ask(robot, binary.echoed_cycle_packet(300, 300, True)) is not None
    robot.firmware.reset(robot.now)
    # the banner is lost
    robot.wait(0.1)
    with pytest.raises(BridgeError, match="the robot was reset"):
        ask(robot, binary.echoed_cycle_packet(300, 300, False))


# e-puck2 over TCP


def test_no_word_over_wifi_before_the_first_command():
    robot = WifiFirmware(Puck(), 0.0)
    assert robot.output(10.0) == b""
    robot.feed(b"\x00\x01hello", 10.0)
    assert robot.output(11.0) == b""


@given(chunks=st.lists(st.integers(1, 200), min_size=1, max_size=30))
@quick
def test_a_wheel_over_wifi(chunks):
    body = Puck()
    body.position = 15
    body.turned = [40_000.0, 0.0]
    robot = WifiFirmware(body, 0.0)
    body.turned = [40_000.0 + 2**15, -5.0]
    command = packets.wifi_command(-700, 1000)
    robot.feed(command[:7], 0.0)
    robot.feed(command[7:], 0.001)
    said = robot.output(0.1)
    assert body.wheels[0].rate == pytest.approx(-704, abs=0.5)
    assert body.wheels[1] == Wheel(1000.0, 0.0)
    parser, found = PacketParser(), []
    for chunk in [*chunks, len(said)]:
        found += parser.feed(said[:chunk])
        said = said[chunk:]
    expected = Sensors(Proximity(COUNTS), LIGHT, Steps(-(2**15), -5), 15)
    assert found == [expected] * 10
    # it goes on for ever, and so do the wheels
    assert len(parser.feed(robot.output(1.0005))) == 90


def test_calibration_over_wifi():
    body = Puck()
    robot = WifiFirmware(body, 0.0)
    robot.feed(packets.wifi_command(0, 0, calibrate=True), 0.0)
    parser = PacketParser()
    found = parser.feed(b"".join(robot.output(k / 200) for k in range(400)))
    assert found[0].proximity == Proximity(COUNTS)
    assert found[-1].proximity == Proximity((0,) * 8)


def test_wifi_drops_what_does_not_fit_its_queue():
    body = Puck()
    robot = WifiFirmware(body, 0.0)
    for speed in range(100, 900, 100):
        robot.feed(packets.wifi_command(speed, 0), 0.0)
    robot.output(1.0)
    assert body.wheels[0].rate == 500


def test_images_are_skipped():
    robot = WifiFirmware(Puck(), 0.0)
    command = bytearray(packets.wifi_command(0, 0))
    command[1] = 0b01 | packets.STREAM_SENSORS
    robot.feed(bytes(command), 0.0)
    said = robot.output(0.0201)
    assert len(said) == 2 * (1 + 38400 + 1 + 104)
    assert len(PacketParser().feed(said)) == 2
    command[1] = 0
    robot.feed(bytes(command), 0.03)
    robot.output(0.0301)
    assert robot.output(0.0501) == b"\x03\x03"


# the wire


def test_a_wire_takes_its_time():
    wire = Wire(latency=0.02, loss=0.0, seed=0)
    wire.send(b"abc", 1.0)
    assert wire.receive(1.0 + 0.02 + 0.5 * BYTE_TIME) == b""
    assert wire.receive(1.0 + 0.02 + 2.5 * BYTE_TIME) == b"ab"
    wire.send(b"d", 1.0)
    assert wire.receive(2.0) == b"cd"
    # a cycle's bytes take 2.4 ms, as the datasheet says
    assert pytest.approx(0.0024, abs=1e-4) == 28 * BYTE_TIME


def test_a_wire_loses_bytes_as_its_seed_says():
    def came(seed):
        wire = Wire(latency=0.0, loss=0.25, seed=seed)
        wire.send(bytes(1000), 0.0)
        return wire.receive(1.0)

    assert 700 < len(came(0)) < 800
    assert came(0) == came(0)
    assert [len(came(seed)) for seed in range(4)] != [len(came(0))] * 4


def test_nothing_wrong_is_believed_over_a_bad_line():
    """Both ways lose bytes: what is read is true, and the two find each other again."""
    robot = standing("asercom")
    there = Wire(latency=0.02, loss=0.005, seed=1)
    back = Wire(latency=0.02, loss=0.005, seed=2)
    truth = Cycle(Proximity(COUNTS), Steps(1234, -4321))

    def wait(duration):
        came = b""
        for _ in range(round(duration / 0.005)):
            robot.now += 0.005
            robot.firmware.feed(there.receive(robot.now), robot.now)
            back.send(robot.firmware.output(robot.now), robot.now)
            came += back.receive(robot.now)
        return came

    def ask(request):
        there.send(request.out, robot.now)
        parser = request.parser()
        for _ in range(60):
            reply = parser.feed(wait(0.005))
            if reply is not None:
                return reply
        return None

    n_good = n_lost = 0
    for k in range(300):
        try:
            # the body of this robot has no wheels to turn
            cycle = ask(binary.echoed_cycle_packet(3 * k, -2 * k, True))
        except BridgeError:
            cycle = None
        if cycle is not None:
            assert cycle == truth
            n_good += 1
            continue
        n_lost += 1
        for _ in range(20):
            there.send(RESYNC.flush, robot.now)
            while wait(RESYNC.quiet + 0.04):
                pass
            try:
                if ask(RESYNC.barrier) is not None and not wait(RESYNC.quiet):
                    break
            except BridgeError:
                pass
        else:
            pytest.fail("never in step again")
    assert n_good > 200
    assert n_lost > 10
