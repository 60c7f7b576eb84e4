"""The emulated robot on its ports: pseudo-terminals, TCP, and its own command line."""

import math
import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.bridge.failures import LinkLost
from epuck_mj.bridge.fake.__main__ import fake
from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.fake.endpoints import Pty, Tcp, serve
from epuck_mj.bridge.fake.scenarios import scenario
from epuck_mj.bridge.fake.simulated_body import SimulatedBody
from epuck_mj.bridge.language import ascii, binary
from epuck_mj.bridge.language.protocol import RESYNC
from epuck_mj.bridge.language.replies import Steps
from epuck_mj.bridge.line.connect import open_port
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_line import SerialLine
from epuck_mj.constants import TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.host.files import read_arrays
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.step.motors import STEP_ANGLE
from tests.processes import PATIENCE, python_process


@contextmanager
def behind(
    endpoint: Pty | Tcp,
    emulator: Emulator,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Emulator]:
    """An emulated robot behind an endpoint, in a thread of ours."""
    end = threading.Event()
    arguments = (emulator, endpoint, clock, lambda: not end.is_set())
    thread = threading.Thread(target=serve, args=arguments)
    thread.start()
    try:
        yield emulator
    finally:
        end.set()
        thread.join(PATIENCE)
        assert not thread.is_alive()


def living(
    endpoint: Pty | Tcp,
    scene: Scene,
    start=(0.0, 0.0, 0.0),
    robot="asercom",
    faults="",
) -> AbstractContextManager[Emulator]:
    """An emulated robot behind an endpoint, in real time."""
    body = SimulatedBody(scene, np.array(start, float), time.monotonic())
    emulator = Emulator(body, robot, time.monotonic(), scenario(faults))
    return behind(endpoint, emulator)


def wait_for(condition, what: str) -> None:
    """Until a condition holds, or fail."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"never {what}"
        time.sleep(0.01)


@pytest.fixture(params=["pty", "tcp"])
def endpoint(request, tmp_path):
    made = Pty(tmp_path / "e-puck") if request.param == "pty" else Tcp(0)
    yield made
    assert not made.is_open


# the body


@pytest.mark.parametrize("robot", RUNGS)
def test_a_body_rolls_as_its_motors_turn(robot):
    scene = load_scene(robot, "arena")
    body = SimulatedBody(scene, np.array([-0.3, 0.0, 0.0]), 10.0)
    emulator = Emulator(body, "asercom", 10.0)
    emulator.exchange(b"D,600,600\r", 10.0)
    for k in range(1000):
        emulator.exchange(b"", 10.0 + k / 200)
    # 600 are 625: section 2 of the datasheet
    expected = 625 * 5 * STEP_ANGLE * WHEEL_RADIUS
    assert body.pose[0] + 0.3 == pytest.approx(expected, rel=0.03)
    assert body.steps()[0] == pytest.approx(3125, abs=15)
    emulator.exchange(b"S\r", 15.0)
    # bytes take their time on the wire
    emulator.exchange(b"", 15.01)
    emulator.exchange(b"", 15.5)
    there = body.pose.copy()
    emulator.exchange(b"", 16.0)
    np.testing.assert_allclose(body.pose, there, atol=1e-5)


def test_a_body_turns_on_the_spot(kinematic):
    body = SimulatedBody(kinematic, np.zeros(3), 0.0)
    emulator = Emulator(body, "asercom", 0.0)
    emulator.exchange(b"D,-500,500\r", 0.0)
    for k in range(400):
        emulator.exchange(b"", k / 200)
    expected = 2 * 500 * 2 * STEP_ANGLE * WHEEL_RADIUS / TRACK
    yaw = np.unwrap([pose[2] for pose in body.journal.pose])
    assert yaw[-1] == pytest.approx(expected, rel=0.03)


def test_a_robot_at_a_wall_pushes_and_goes_on_counting(wheels):
    body = SimulatedBody(wheels, np.array([0.42, 0.0, 0.0]), 0.0)
    emulator = Emulator(body, "asercom", 0.0)
    emulator.exchange(b"D,1000,1000\r", 0.0)
    for k in range(600):
        emulator.exchange(b"", k / 200)
    assert body.journal.contact[-1]
    assert body.pose[0] < 0.5
    assert body.steps()[0] > 2800


def test_pauses_of_slow_motors_are_lost_way(kinematic):
    def way(again):
        body = SimulatedBody(kinematic, np.zeros(3), 0.0)
        emulator = Emulator(body, "asercom", 0.0)
        for k in range(200):
            told = k == 0 or (again and k % 10 == 0)
            emulator.exchange(b"D,300,300\r" if told else b"", k / 100)
        return body.steps()[0]

    # 4.9 steps/s: section 2 of the datasheet
    assert way(False) - way(True) == pytest.approx(2 * 4.9, abs=2)


# its ports


def test_a_robot_answers_on_its_port(endpoint, kinematic):
    with living(endpoint, kinematic):
        line = SerialLine(Link(lambda: open_port(endpoint.name)))
        try:
            assert line.greet().firmware.startswith("Version 1.2.2")
            cycle = line.cycle(400, -400, True, math.inf)
            assert cycle.steps == Steps(0, 0)
            line.stop()
        finally:
            line.close()


def test_the_program_in_the_document(kinematic, tmp_path, capsys):
    text = (Path(__file__).parent.parent / "docs" / "bridge.md").read_text()
    [script] = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    port = Pty(tmp_path / "e-puck")
    with living(port, kinematic) as emulator:
        exec(script.replace("/tmp/e-puck", port.name), {})
        assert emulator.body.standing
    out = capsys.readouterr().out
    assert re.search(r"^Version 1\.2.*\nCycle\(.*left=3\d\d, right=-3\d\d\)", out)


def test_one_host_after_the_other(endpoint, kinematic):
    with living(endpoint, kinematic):
        for _ in range(2):
            line = SerialLine(Link(lambda: open_port(endpoint.name)))
            try:
                line.greet()
            finally:
                line.close()


def test_a_port_vanishes_and_returns(endpoint, kinematic):
    name = endpoint.name
    with living(endpoint, kinematic, faults="disconnect@0.5+0.5") as emulator:
        link = Link(lambda: open_port(name))
        try:
            link.resync(time.monotonic() + PATIENCE)
            link.ask(binary.echoed_cycle_packet(300, 300, True))
            with pytest.raises(LinkLost):
                while True:
                    link.drain(time.monotonic() + 0.02)
            # nothing stops a robot that nobody can reach
            assert not emulator.body.standing
            link.reopen(time.monotonic() + PATIENCE)
            assert endpoint.name == name
            link.resync(time.monotonic() + PATIENCE)
            link.ask(ascii.stop_order())
            assert emulator.body.standing
        finally:
            link.close()


def test_a_port_that_is_gone(endpoint, kinematic):
    with living(endpoint, kinematic, faults="gone@0"):
        link = Link(lambda: open_port(endpoint.name))
        try:
            with pytest.raises(LinkLost):
                link.resync(time.monotonic() + PATIENCE)
            with pytest.raises(LinkLost, match="port"):
                link.reopen(time.monotonic() + 0.3)
        finally:
            link.close()


def test_ports_that_cannot_be_made(tmp_path):
    with pytest.raises(UserError, match="cannot make"):
        Pty(tmp_path / "no" / "e-puck")
    taken = tmp_path / "taken"
    taken.touch()
    with pytest.raises(UserError, match=r"cannot make .*File exists"):
        Pty(taken)
    assert taken.exists()
    first = Tcp(0)
    try:
        with pytest.raises(UserError, match="cannot listen on port"):
            Tcp(int(first.name.rpartition(":")[2]))
        with pytest.raises(UserError, match="cannot listen on port 70000"):
            Tcp(70_000)
    finally:
        first.close()


# its command line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--arena", "nowhere"], "no arena 'nowhere'"),
        (["--robot", "nobody"], "no robot 'nobody'"),
        (["--firmware", "windows"], "no robot 'windows'; available: asercom, btcom"),
        (["--scenario", "stall"], "expected faults as in stall@2"),
        (["--speed", "0"], "expected --speed above 0"),
        (["--latency", "-1"], "expected --latency from 0"),
        (["--journal", "no/robot.npz"], "cannot write .*no folder 'no'"),
        (["--pose", "nan", "0", "0"], "expected --pose of finite numbers"),
        (["--tcp", "0", "--link", "x"], "expected one of --link, --tcp and --wifi"),
        (["--tcp", "99999"], "port 99999: expected one from 0 to 65535"),
        (["--link", "/no/such/folder"], "cannot make '/no/such/folder'"),
        (["--nonsense"], "nonsense"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(UserError, match=message) as caught:
        fake(arguments)
    assert "\n" not in str(caught.value)


@contextmanager
def fake_process(*arguments: str) -> Iterator[tuple[subprocess.Popen, str]]:
    """An emulated robot as a process of its own, and the name of its port."""
    module = ("-W", "error", "-m", "epuck_mj.bridge.fake")
    with python_process(*module, *arguments) as process:
        watch = threading.Timer(PATIENCE, process.kill)
        watch.start()
        try:
            assert process.stdout is not None
            name = ""
            while not name:
                line = process.stdout.readline()
                assert line, process.communicate(timeout=PATIENCE)
                name = line.removeprefix("port: ").strip() if "port: " in line else ""
        finally:
            watch.cancel()
        yield process, name


@pytest.mark.slow
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_its_process(tmp_path, signum):
    journal = tmp_path / "journal.npz"
    arguments = ["--journal", str(journal), "--speed", "5"]
    with fake_process(*arguments, "--scenario", "random") as (process, name):
        assert Path(name).is_symlink()
        handle = os.open(name, os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(handle, RESYNC.flush + b"D,500,-500\r")
        finally:
            os.close(handle)
        time.sleep(0.5)
        process.send_signal(signum)
        out, error = process.communicate(timeout=PATIENCE)
    assert (process.returncode, error) == (0, "")
    assert "yaw" in out
    assert not Path(name).is_symlink()
    arrays = read_arrays(journal)
    assert arrays["timestep"] == 0.01
    assert len(arrays["pose"]) > 10
    assert len(arrays["sample"]) == len(arrays["sample_step"])
