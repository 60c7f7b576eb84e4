"""`python -m epuck_mj.bridge` on emulated robots, on real ports and in real time.

In a process of its own where it drives as planned on each kind of port, and where it
ends in another way than by itself; elsewhere in this one, which saves its imports.
"""

import contextlib
import io
import itertools
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from rerun.chunk import RrdReader

from epuck_mj.bridge.__main__ import bridge
from epuck_mj.bridge.drive import alone
from epuck_mj.bridge.drive.console import drive_summary, live_line
from epuck_mj.bridge.drive.mission import Mission, accomplish
from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.fake.endpoints import Pty, Tcp
from epuck_mj.bridge.fake.motors_and_sensors import Wheel
from epuck_mj.bridge.line.connect import SOCKET_SCHEME, WIFI_SCHEME, connect
from epuck_mj.constants import SPEED_MAX, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.host.interruption import SIGNALS, Interrupted, Interruption
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.trials.trajectory import Trajectory
from tests.fleets import befall
from tests.no_pictures import BRIDGE, show_nothing
from tests.processes import PATIENCE, python_process
from tests.test_fake import fake_process, living, wait_for

ROOT = Path(__file__).resolve().parent.parent
CHAMPION = ROOT / "benchmarks" / "controllers" / "fragile.json"
AT_WALL = (0.44, 0.0, np.pi / 2)
MODULE = ("-W", "error", "-m", "epuck_mj.bridge")


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """Of bridges in this process."""
    show_nothing(monkeypatch)


@pytest.fixture
def port(tmp_path):
    return Pty(tmp_path / "e-puck")


def command(port, log, *arguments, champion: str | Path = "wall-follower"):
    return [
        *(*MODULE, str(champion)),
        *("--port", str(port), "--log", str(log), *arguments),
    ]


def started(port, log, *arguments, **options):
    """A bridge that is under way; killed if it hangs. It draws nothing."""
    arguments = command(port, log, *arguments)[len(MODULE) :]
    return python_process("-W", "error", "-c", BRIDGE, *arguments, **options)


BUSY = r"did not answer for 0\.3 s|did not ask for 0\.3 s"
"""What is said of a reading that did not come in time: this machine may be busy."""


@dataclass(frozen=True)
class Done:
    """How a bridge ended, and what it said."""

    returncode: int
    stdout: str
    stderr: str


def by_itself(arguments: list[str]) -> Done:
    """A bridge in a process of its own, from start to end, with its pictures."""
    done = subprocess.run(
        [sys.executable, *arguments],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    return Done(done.returncode, done.stdout, done.stderr)


def by_itself_undrawn(arguments: list[str]) -> Done:
    """The same without its pictures."""
    return by_itself(["-W", "error", "-c", BRIDGE, *arguments[len(MODULE) :]])


def in_here(arguments: list[str]) -> Done:
    """A bridge in this process, from start to end."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            status = bridge(arguments[len(MODULE) :])
        except UserError as refused:
            status = 2
            print(f"error: {refused}", file=error)
    return Done(status, out.getvalue(), error.getvalue())


def run(
    port,
    log,
    *arguments,
    champion: str | Path = "wall-follower",
    disturbed: bool = False,
    how: Callable[[list[str]], Done] = in_here,
) -> Done:
    """A bridge from start to end.

    Where nothing goes wrong on purpose, a machine so busy that the watchdog saw it
    gets a second and a third chance.
    """
    for chance in (3, 2, 1):
        done = how(command(port, log, *arguments, champion=champion))
        if disturbed or chance == 1 or not re.search(BUSY, done.stderr):
            return done
    raise AssertionError("unreachable")


@pytest.fixture
def fault_on_the_way(at_each_line):
    """Lets something happen to a robot that drives: at its third line."""

    def set_up(emulator: Emulator, fault: str) -> None:
        lines = itertools.count(1)

        def line():
            if next(lines) == 3:
                assert not emulator.body.standing
                befall(emulator, fault)

        at_each_line(line)

    return set_up


@pytest.fixture
def at_each_line(monkeypatch):
    """Does something whenever a bridge in this process says how it drives."""

    def set_up(action: Callable[[], object]) -> None:
        def acting(step, robot):
            action()
            return live_line(step, robot)

        monkeypatch.setattr(alone, "QUIET_PERIOD", 0.3)
        monkeypatch.setattr(alone, "live_line", acting)

    return set_up


def moving(emulator):
    wait_for(lambda: not emulator.body.standing, "drove")


# as planned


@pytest.mark.slow
def test_a_champion_drives_a_robot(kinematic, port, tmp_path):
    log = tmp_path / "logs" / "drive.1"
    with living(port, kinematic, AT_WALL) as emulator:
        pose = ["0.44", "0", "90"]
        done = run(
            port.name,
            log,
            *("--seconds", "2", "--pose", *pose),
            champion=CHAMPION,
            how=by_itself,
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert emulator.body.standing
        moved = np.linalg.norm(emulator.body.pose[:2] - AT_WALL[:2])
    for text in (
        "Version 1.2.2 August 2008 GCtronic, HW version: 1.1; battery good",
        "control steps  20,",
        "latency        median",
        "odometry ",
        "fitness ",
        "drive.1.npz",
        "drive.1.rrd",
        "drive.1.png",
        "ended; the robot stands still",
    ):
        assert text in done.stdout
    trajectory = Trajectory.load(tmp_path / "logs" / "drive.1.npz")
    assert trajectory.steps == 20
    assert trajectory.hidden.shape == (20, 4)
    np.testing.assert_allclose(trajectory.pose[0], AT_WALL, atol=1e-9)
    by_odometry = np.linalg.norm(trajectory.pose[-1, :2] - AT_WALL[:2])
    assert moved == pytest.approx(by_odometry, abs=0.05)
    assert moved > 0.05
    entities = RrdReader(tmp_path / "logs" / "drive.1.rrd").store()
    assert entities is not None
    pixels = imread(tmp_path / "logs" / "drive.1.png")
    # white paper, and a path and walls on it
    assert 0.05 < (pixels[..., :3].min(axis=-1) < 0.9).mean() < 0.5


WITHOUT_PICTURES = """
import sys
from epuck_mj.bridge.__main__ import bridge
from epuck_mj.bridge.drive import alone

line = alone.live_line

def watched(*arguments):
    assert not {"matplotlib", "rerun"} & set(sys.modules)
    return line(*arguments)

alone.live_line = watched
sys.exit(bridge(sys.argv[1:]))
"""


@pytest.mark.slow
def test_pictures_are_for_robots_that_stand(kinematic, port, tmp_path):
    """What draws them takes its time to load."""
    with living(port, kinematic, AT_WALL):
        done = run(
            port.name,
            tmp_path / "log",
            *("--seconds", "1.5"),
            how=lambda arguments: by_itself(
                ["-c", WITHOUT_PICTURES, *arguments[len(MODULE) :]]
            ),
        )
    assert (done.returncode, done.stderr) == (0, "")
    assert " over\n" in done.stdout
    assert (tmp_path / "log.png").stat().st_size > 1000


@pytest.mark.slow
def test_over_tcp_with_everything_asked_for(kinematic, tmp_path):
    Calibration(track=0.055).save(tmp_path / "robot.yaml")
    endpoint = Tcp(0)
    with living(endpoint, kinematic, AT_WALL) as emulator:
        done = run(
            endpoint.name,
            tmp_path / "log",
            *("--seconds", "1", "--calibrate", "--max-speed", "0.03"),
            *("--calibration", str(tmp_path / "robot.yaml")),
            how=by_itself_undrawn,
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert emulator.body.standing
    assert "keep 20 cm around the robot clear" in done.stdout
    assert "calibrated" in done.stdout
    trajectory = Trajectory.load(tmp_path / "log.npz")
    assert np.abs(trajectory.command).max() * WHEEL_RADIUS < 0.03 + 0.001
    # what the operator sees is what was sent: 0.03 m/s are 233 steps/s
    left, right = re.findall(r" D +(-?\d+) +(-?\d+) ", done.stdout)[-1]
    assert 0 < max(abs(int(left)), abs(int(right))) <= 234
    # zeroed where it stood
    np.testing.assert_array_equal(trajectory.proximity[0], 0)


@pytest.mark.slow
def test_a_dry_run(kinematic, port, tmp_path):
    with living(port, kinematic, AT_WALL) as emulator:
        done = run(port.name, tmp_path / "log", "--seconds", "1", "--dry-run")
        assert (done.returncode, done.stderr) == (0, "")
        assert not any(row[0] or row[2] for row in emulator.body.journal.command)
        np.testing.assert_allclose(emulator.body.pose, AT_WALL, atol=1e-6)
    assert "DRY RUN" in done.stdout
    # what it would have done
    assert not re.search(r" D +0 +0 ", done.stdout)
    trajectory = Trajectory.load(tmp_path / "log.npz")
    assert trajectory.steps == 10
    assert not trajectory.command.any()


class Onlooker:
    """A watcher that lets a drive go on."""

    def say(self, text):
        pass

    def met(self, greeting, robot):
        pass

    def saw(self, step, robot):
        return False


@pytest.mark.slow
def test_a_network_of_ones_own_that_fails(kinematic, tmp_path):
    """The robot stands, the log stays, and the status is not that of no drive."""
    calls = itertools.count()

    def policy(observation):
        if next(calls) == 5:
            raise UserError("network 'own.py:own' failed")
        return WallFollower()(observation)

    endpoint = Pty(tmp_path / "e-puck")
    with living(endpoint, kinematic) as emulator, Interruption() as interruption:
        mission = Mission(
            policy=policy,
            task=TaskParameters(),
            calibration=Calibration(),
            n_steps=20,
            start=(0.0, 0.0, 0.0),
            speed_max=SPEED_MAX,
            dry_run=False,
            calibrate=False,
            log=tmp_path / "log",
            verbose=False,
        )
        outcome = accomplish(
            mission, lambda: connect(endpoint.name), Onlooker(), interruption
        )
        assert emulator.body.standing
    assert outcome.status == 3
    assert outcome.word == (
        "error: network 'own.py:own' failed; the robot was stopped and stands still"
    )
    assert Trajectory.load(tmp_path / "log.npz").steps == 5


@pytest.mark.slow
def test_over_wifi(kinematic, tmp_path):
    endpoint = Tcp(0, WIFI_SCHEME)
    with living(endpoint, kinematic, AT_WALL, "wifi") as emulator:
        name = endpoint.name
        arguments = ("--seconds", "1", "--calibrate")
        done = run(name, tmp_path / "log", *arguments, how=by_itself_undrawn)
        assert emulator.body.standing
    assert (done.returncode, done.stderr) == (0, "")
    assert "e-puck2 over WiFi, selector at 15" in done.stdout
    trajectory = Trajectory.load(tmp_path / "log.npz")
    assert trajectory.steps == 10
    # zeroed where it stood
    np.testing.assert_array_equal(trajectory.proximity[0], 0)
    assert np.linalg.norm(trajectory.pose[-1, :2] - AT_WALL[:2]) > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["stall@{}", "disconnect@{}+0.5", "gone@{}"])
def test_faults_over_wifi(kinematic, tmp_path, fault, fault_on_the_way):
    endpoint = Tcp(0, WIFI_SCHEME)
    with living(endpoint, kinematic, AT_WALL, "wifi") as emulator:
        fault_on_the_way(emulator, fault)
        name = endpoint.name
        done = run(name, tmp_path / "log", disturbed=True)
        assert emulator.body.standing == (fault != "gone@{}")
    assert done.returncode == (4 if fault == "gone@{}" else 3), done.stderr
    assert done.stderr.count("\n") == 1
    assert "e-puck2 over WiFi, selector at 15" in done.stdout
    trajectory = Trajectory.load(tmp_path / "log.npz")
    assert trajectory.steps > 5
    assert np.linalg.norm(trajectory.pose[-1, :2] - AT_WALL[:2]) > 0.02


# every way out


@pytest.mark.slow
def test_a_signal_to_a_process(kinematic, port, tmp_path):
    """And another one; see also test_a_busy_port."""
    with (
        living(port, kinematic) as emulator,
        started(port.name, tmp_path / "log") as process,
    ):
        moving(emulator)
        process.send_signal(signal.SIGHUP)
        # further ones do no harm
        time.sleep(0.02)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=PATIENCE)
        assert process.returncode == 128 + signal.SIGHUP
        assert emulator.body.standing
    assert error == "SIGHUP: ended, the robot stands still\n"
    assert Trajectory.load(tmp_path / "log.npz").steps >= 0


@pytest.mark.slow
@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize(
    "signum",
    [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP],
)
def test_signals(kinematic, port, tmp_path, signum, at_each_line, monkeypatch):
    with living(port, kinematic, AT_WALL) as emulator:

        def interrupted():
            assert not emulator.body.standing
            os.kill(os.getpid(), signum)

        def summarized(*arguments):
            # further ones do no harm
            os.kill(os.getpid(), signal.SIGTERM)
            return drive_summary(*arguments)

        at_each_line(interrupted)
        monkeypatch.setattr(alone, "drive_summary", summarized)
        done = run(port.name, tmp_path / "log")
        assert emulator.body.standing
    assert done.returncode == 128 + signum
    assert done.stderr == f"{signum.name}: ended, the robot stands still\n"
    assert "control steps" in done.stdout
    assert Trajectory.load(tmp_path / "log.npz").steps > 0


@pytest.mark.slow
def test_the_operators_key(kinematic, port, tmp_path, at_each_line, monkeypatch):
    master, slave = pty.openpty()
    try:
        with (
            living(port, kinematic, AT_WALL) as emulator,
            os.fdopen(slave, closefd=False) as keys,
        ):

            def pressed():
                assert not emulator.body.standing
                os.write(master, b"xq")

            at_each_line(pressed)
            monkeypatch.setattr(sys, "stdin", keys)
            done = run(port.name, tmp_path / "log")
            assert (done.returncode, done.stderr) == (0, "")
            assert emulator.body.standing
    finally:
        os.close(master)
        os.close(slave)
    assert "q or space stops" in done.stdout
    assert "stopped by the operator's key; the robot stands still" in done.stdout


@pytest.mark.slow
def test_a_reader_that_went_away(kinematic, port, tmp_path):
    with (
        living(port, kinematic) as emulator,
        started(port.name, tmp_path / "log") as process,
    ):
        moving(emulator)
        assert process.stdout is not None
        process.stdout.close()
        process.stdout = None
        process.wait(PATIENCE)
        assert process.returncode == 1
        assert emulator.body.standing


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "status", "cause"),
    [
        ("stall@{}", 3, "the robot did not answer for 0.3 s, so it was stopped"),
        ("reset@{}", 3, "the robot "),
        ("disconnect@{}+0.5", 3, "the connection to the robot was lost, so it was sto"),
        (
            "gone@{}",
            4,
            "THE MOTORS MAY STILL TURN, switch the robot off: the robot did not "
            "confirm that it stopped; before that, the connection to the robot was l",
        ),
        ("loss@{}+100", 3, "the robot did not answer for 0.3 s, so it was stopped"),
    ],
)
def test_faults(kinematic, port, tmp_path, fault, status, cause, fault_on_the_way):
    with living(port, kinematic, AT_WALL) as emulator:
        fault_on_the_way(emulator, fault)
        done = run(port.name, tmp_path / "log", disturbed=True)
        assert emulator.body.standing == (status != 4)
    assert done.returncode == status
    _assert_told(done, tmp_path / "log.npz", cause)


@pytest.mark.slow
@pytest.mark.parametrize(
    "faults",
    [
        "noise@0.8,noise@1,noise@1.2,noise@1.4,noise@1.6,noise@1.8",
        "garbage@1,garbage@1.5",
    ],
)
def test_faults_that_a_drive_may_survive(kinematic, port, tmp_path, faults):
    with living(port, kinematic, AT_WALL, faults=faults) as emulator:
        done = run(port.name, tmp_path / "log", "--seconds", "2", disturbed=True)
        assert emulator.body.standing
    assert done.returncode in (0, 3)
    _assert_told(done, tmp_path / "log.npz")


def _assert_told(done: Done, log: Path, cause: str = "") -> None:
    """A drive that failed says why in a line, and keeps what was seen until then."""
    if done.returncode:
        assert done.stderr.startswith("error: ")
        assert done.stderr.count("\n") == 1
        assert cause in done.stderr
        # details are for those who ask for them
        assert "expected" not in done.stderr
    assert Trajectory.load(log).steps > 0
    assert "control steps" in done.stdout


@pytest.mark.slow
def test_a_robot_that_dies(tmp_path, at_each_line):
    # a machine so busy that the watchdog was first gets more chances
    for chance in (3, 2, 1):
        with fake_process("--tcp", "0") as (robot, name):
            at_each_line(robot.kill)
            done = run(name, tmp_path / "log", "--verbose", disturbed=True)
        if chance == 1 or done.returncode == 4:
            break
    assert done.returncode == 4
    error = done.stderr
    assert error.startswith("error: THE MOTORS MAY STILL TURN, switch the robot off")
    assert "Details: expected the robot to say that it stopped; got none" in error
    assert "Connection refused" in error
    assert error.count("\n") == 1
    assert Trajectory.load(tmp_path / "log.npz").steps > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pty", "tcp", "wifi"])
def test_a_bridge_that_is_killed(kinematic, tmp_path, kind):
    """`kill -9` too: its guardian stops the robot, and lets go of the port."""
    scheme = WIFI_SCHEME if kind == "wifi" else SOCKET_SCHEME
    endpoint = Pty(tmp_path / "e-puck") if kind == "pty" else Tcp(0, scheme)
    robot = "wifi" if kind == "wifi" else "asercom"
    with living(endpoint, kinematic, robot=robot) as emulator:
        name = endpoint.name
        with started(name, tmp_path / "log") as process:
            moving(emulator)
            process.kill()
            process.wait(PATIENCE)
            killed = time.monotonic()
            wait_for(lambda: emulator.body.standing, "stood")
        # measured as 20 ms; this machine may be busy
        assert time.monotonic() - killed < 5
        wait_for(
            lambda: run(name, tmp_path / "log", "--seconds", "0.1").returncode == 0,
            "was there for the next",
        )
        assert emulator.body.standing


@pytest.mark.slow
def test_the_next_bridge_stops_a_robot_first(kinematic, port, tmp_path):
    with living(port, kinematic) as emulator:
        emulator.body.drive(Wheel(500.0, 0.0), Wheel(500.0, 0.0))
        done = run(port.name, tmp_path / "log", "--seconds", "0.1", "--dry-run")
        assert done.returncode == 0
        assert emulator.body.standing


# bad input


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "expected the directory of a finished run, a controller file, wall-fol"),
        (["wall-follower"], "expected --port; --list-ports"),
        (["no.json", "--port", "x"], "cannot read 'no.json'"),
        (["README.md", "--port", "x"], "'README.md' is not JSON"),
        (["wall-follower", "--port", "/dev/nope"], "no port '/dev/nope'; available"),
        (["wall-follower", "--port", "/dev/null"], "is not a serial port"),
        (["wall-follower", "--port", "socket://127.0.0.1:1"], "Connection refused"),
        (["wall-follower", "--port", "x", "--seconds", "0"], "--seconds: expected"),
        (["wall-follower", "--port", "x", "--seconds", "nan"], "--seconds: expected"),
        (["wall-follower", "--port", "x", "--max-speed", "1"], "expected --max-speed"),
        (["wall-follower", "--port", "x", "--pose", "0", "0", "inf"], "finite"),
        (["wall-follower", "--port", "x", "--arena", "no"], "no arena 'no'"),
        (["wall-follower", "--port", "x", "--calibration", "no"], "cannot read 'no'"),
        (["wall-follower", "--port", "x", "--log", "/proc/x/y"], "cannot write"),
        (["wall-follower", "--port", "x", "--log", "."], "expected --log"),
        (["wall-follower", "--port", "tcp://[::1"], "expected tcp://host"),
        (["wall-follower", "--port", "x", "--nonsense"], "nonsense"),
    ],
)
def test_bad_input(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "README.md").write_text("hello")
    with pytest.raises(UserError, match=message) as caught:
        bridge(arguments)
    assert "\n" not in str(caught.value)


def test_a_champion_of_another_network(tmp_path):
    file = ControllerFile(
        Network(hidden=5), np.zeros(50), TaskParameters(), Origin("a", "b"), {}
    )
    path = tmp_path / "champion.json"
    path.write_text(file.to_json().replace('"hidden": 5', '"hidden": 4'))
    with pytest.raises(UserError, match=r"expected 40 genes, got 50"):
        bridge([str(path), "--port", "x"])


def test_the_directory_of_a_run_is_its_champion(tmp_path):
    (tmp_path / "champion.json").write_text(CHAMPION.read_text())
    log = ["--log", str(tmp_path / "log")]
    with pytest.raises(UserError, match="no port '/dev/nope'"):
        bridge([str(tmp_path), "--port", "/dev/nope", *log])
    (tmp_path / "champion.json").unlink()
    with pytest.raises(UserError, match=r"no champion in .*: its run is not"):
        bridge([str(tmp_path), "--port", "/dev/nope", *log])


@pytest.mark.slow
def test_a_device_that_is_no_robot(tmp_path):
    """It echoes whatever it hears: one line, status 2, and soon."""
    master, slave = pty.openpty()
    end = threading.Event()

    def echo():
        while not end.is_set():
            try:
                os.write(master, os.read(master, 100))
            except OSError:
                return

    thread = threading.Thread(target=echo)
    thread.start()
    try:
        done = run(os.ttyname(slave), tmp_path / "log")
    finally:
        end.set()
        os.write(slave, b"x")
        thread.join(PATIENCE)
        os.close(slave)
        os.close(master)
    assert done.returncode == 2
    assert done.stderr.startswith("error: the robot did not answer. Is it switched on")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_busy_port(kinematic, port, tmp_path):
    with (
        living(port, kinematic) as emulator,
        started(port.name, tmp_path / "log", "--seconds", "600") as first,
    ):
        moving(emulator)
        done = run(port.name, tmp_path / "other")
        assert done.returncode == 2
        assert done.stderr == (
            f"error: port '{port.name}' is busy: another program has it. Close that "
            "program, or wait a minute: some systems try a new port for themselves\n"
        )
        first.send_signal(signal.SIGINT)
        _, error = first.communicate(timeout=PATIENCE)
        assert first.returncode == 130
        assert emulator.body.standing
    assert error == "SIGINT: ended, the robot stands still\n"


LOADED = """
import contextlib, io, runpy, sys
for module in sys.argv[1:]:
    for argument in ("--help", "--list-ports", "--nonsense"):
        sys.argv = ["x", argument]
        with contextlib.redirect_stdout(io.StringIO()):
            try:
                runpy.run_module(module, run_name="__main__")
            except SystemExit as end:
                print(module, argument, end.code, file=sys.stderr)
heavy = {"mujoco", "dm_control", "scipy", "rerun", "matplotlib"}
print(*sorted(heavy & set(sys.modules)))
"""
"""What commands load that only have to say something."""


def test_help_costs_no_physics():
    modules = [f"epuck_mj.{name}" for name in ("bridge", "bridge.fake", "calibrate")]
    done = subprocess.run(
        [sys.executable, "-c", LOADED, *modules],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr
    assert done.stderr.count("error: unknown option --nonsense") == 3
    for module in modules:
        assert f"{module} --help 0\n" in done.stderr
        assert f"{module} --nonsense 2\n" in done.stderr
    assert f"{modules[0]} --list-ports 0\n" in done.stderr


# signals


def test_signals_raise_where_they_may_only(handlers):
    with Interruption() as interruption:
        signal.raise_signal(signal.SIGTERM)
        assert interruption.signum == signal.SIGTERM
        with pytest.raises(Interrupted), interruption.raising():
            pytest.fail("one came before")
        signal.raise_signal(signal.SIGINT)
        assert interruption.signum == signal.SIGTERM
    # what follows is the end of the process
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN


def test_a_second_signal_breaks_nothing_off(handlers):
    with (
        Interruption() as interruption,
        pytest.raises(Interrupted),
        interruption.raising(),
    ):
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGINT)
    assert interruption.signum == signal.SIGINT


def test_what_fails_to_clear_up_hides_no_signal(handlers):
    """As zipfile does, where it is interrupted in the middle of a file."""
    with (
        Interruption() as interruption,
        pytest.raises(Interrupted) as caught,
        interruption.raising(),
    ):
        try:
            try:
                signal.raise_signal(signal.SIGINT)
            finally:
                raise ValueError("an open writing handle")
        except ValueError as error:
            raise UserError("cannot be written") from error
    assert isinstance(caught.value.__cause__, UserError)


def test_other_mistakes_stay_what_they_are(handlers):
    with (
        Interruption() as interruption,
        pytest.raises(UserError),
        interruption.raising(),
    ):
        try:
            raise KeyError("a")
        except KeyError:
            raise UserError("b") from None


def test_without_a_signal_handlers_are_as_before(handlers):
    with Interruption() as interruption, interruption.raising():
        assert signal.getsignal(signal.SIGTERM) is not handlers[signal.SIGTERM]
    assert {signum: signal.getsignal(signum) for signum in SIGNALS} == handlers


def test_top_speed_in_whole_steps():
    assert pytest.approx(1000 * STEP_ANGLE * WHEEL_RADIUS) == SPEED_MAX
