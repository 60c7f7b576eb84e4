"""Several robots at once: emulated ones on real ports, in real time.

The fleet and its drivers are processes of their own; the robots live in this one.
"""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from epuck_mj.bridge.__main__ import bridge
from epuck_mj.bridge.drive.order import Order
from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.fleet import crew, fleet_drive, screen
from epuck_mj.bridge.fleet.driver import MODULE
from epuck_mj.bridge.fleet.members import Member, members_at, read_fleet
from epuck_mj.constants import WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.host.output import Output
from epuck_mj.step.calibration import Calibration
from epuck_mj.trials.trajectory import Trajectory
from tests.fleets import Terminal, all_move, befall, robots, slowest_stop
from tests.no_pictures import BRIDGE, show_nothing
from tests.processes import PATIENCE, python_process
from tests.test_fake import wait_for

CHAMPION = Path(__file__).parent.parent / "benchmarks" / "controllers" / "fragile.json"

FAULTS = {
    "disconnect@{}+0.4": "the connection to the robot was lost, so it was stopped",
    "gone@{}": "THE MOTORS MAY STILL TURN, switch the robot off: the robot did",
    "stall@{}+0.6": "the robot did not answer for 0.3 s, so it was stopped",
}
"""Faults with the word that follows."""

STANDS = 0.5
"""Longest time from what stops a fleet to wheels that stand [s]."""


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """Of fleets in this process."""
    show_nothing(monkeypatch)


def command(ports, log, *arguments: str) -> list[str]:
    """Of a fleet at these ports, which draws nothing."""
    asked = [part for port in ports for part in ("--port", port)]
    return [
        *("-W", "error", "-c", BRIDGE, "wall-follower", *asked),
        *("--log", str(log), *arguments),
    ]


@contextmanager
def on_a_terminal(arguments: list[str]):
    """A fleet whose keyboard and screen are a terminal: its process and that."""
    terminal = Terminal()
    try:
        with python_process(
            *arguments, stdin=terminal.slave, stdout=terminal.slave
        ) as process:
            yield process, terminal
    finally:
        terminal.close()


def ever_drove(emulator: Emulator) -> bool:
    return any(row[0] or row[2] for row in emulator.body.journal.command)


def driven(log: Path, name: str) -> Trajectory:
    return Trajectory.load(log / f"{name}.npz")


# members


def test_members_of_a_file(tmp_path):
    path = tmp_path / "fleet.yaml"
    path.write_text(
        "anna: {port: /dev/rfcomm0, controller: a.json, calibration: anna.yaml}\n"
        "bert:\n  port: COM5\n  controller: wall-follower\n"
    )
    assert read_fleet(path) == (
        Member("anna", "/dev/rfcomm0", "a.json", "anna.yaml"),
        Member("bert", "COM5", "wall-follower"),
    )


def test_the_file_in_the_document(tmp_path):
    text = (CHAMPION.parents[2] / "docs" / "bridge.md").read_text()
    [example] = re.findall(r"^```yaml\n(.*?)^```", text, re.M | re.S)
    (tmp_path / "fleet.yaml").write_text(example)
    assert [member.name for member in read_fleet(tmp_path / "fleet.yaml")] == [
        *("anna", "bert", "carl")
    ]


def test_members_at_ports():
    assert members_at(["A", "B"], "x") == (
        Member("robot-1", "A", "x"),
        Member("robot-2", "B", "x"),
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a mapping of keys to values"),
        ("- a", "expected a mapping of keys to values"),
        ("{}", "expected from 1 to 40 robots, got 0"),
        ("a: /dev/x", "robot 'a': expected the keys port, controller, calibration"),
        ("a: {port: x}", "robot 'a': expected a controller, got none"),
        ("a: {controller: x}", "robot 'a': expected a port, got none"),
        ("a: {port: 5, controller: x}", "robot 'a': expected a text as port, got 5"),
        ("a: {port: '', controller: x}", "expected a text as port, got ''"),
        (
            "a: {port: p, controller: c, pose: 1}",
            "unknown 'pose'; available: port, con",
        ),
        ("a/b: {port: p, controller: c}", "'a/b': expected a name of at most 20"),
        ("..: {port: p, controller: c}", "'..': expected a name of at most 20"),
        ("1: {port: p, controller: c}", "robot 1: expected a name of at most 20"),
        ("a: {port: p, port: q, controller: c}", "key 'port' appears twice"),
        ("a: &x {port: p, controller: c}\nb: *x", "a and b have the same port"),
        (
            "a: {port: p, controller: c}\nA: {port: q, controller: c}",
            "a and A have the same name",
        ),
        ("a: {port: x, controller: no.json}", "robot a: cannot read 'no.json'"),
        (
            "a: {port: x, controller: wall-follower, calibration: no.yaml}",
            "robot a: cannot read 'no.yaml'",
        ),
    ],
)
def test_bad_files(text, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("fleet.yaml").write_text(text)
    with pytest.raises(UserError, match=re.escape(message)) as caught:
        bridge(["--fleet", "fleet.yaml"])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["x", "--fleet", "f"], "expected --fleet alone"),
        (["--fleet", "f", "--port", "x"], "expected --fleet alone"),
        (["--fleet", "f"], "cannot read 'f'"),
        (["x", "--port", "a", "--port", "a"], "have the same port"),
        (
            ["x", "--port", "a", "--port", "b", "--pose", "0", "0", "0"],
            "expected --pose with one robot",
        ),
        (
            ["x", "--port", "a", "--port", "b", "--calibration", "c"],
            "expected --calibration with one robot",
        ),
        (
            ["wall-follower", "--port", "a", "--port", "b", "--log", "/proc/x"],
            "cannot write",
        ),
    ],
)
def test_bad_input(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=re.escape(message)) as caught:
        bridge(arguments)
    assert "\n" not in str(caught.value)


def test_an_order_survives_its_way():
    order = Order("p", "c", None, 1.5, (0.1, 0.2, 0.3), None, True, False, "l", True)
    assert Order.from_json(order.to_json()) == order


def test_drivers_load_no_physics_and_no_pictures():
    """Ten of them have to start soon, and matplotlib is for robots that stand."""
    code = (
        f"import sys, {MODULE}, epuck_mj.bridge.__main__\n"
        "print({'mujoco', 'rerun', 'matplotlib', 'numba', 'scipy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("set()\n", "")


# the screen


class Lines:
    """What a terminal of 80 columns shows of a stream of text."""

    def __init__(self):
        self.lines = [""]
        self.lost = False
        self._row = 0

    def say(self, text: str) -> None:
        for part in re.split(r"(\x1b\[\d+A\r|\x1b\[J|\n)", f"{text}\n"):
            if up := re.fullmatch(r"\x1b\[(\d+)A\r", part):
                self._row -= int(up[1])
                assert self._row >= 0
            elif part == "\x1b[J":
                self.lines[self._row :] = [""]
            elif part == "\n":
                self._row += 1
                self.lines[self._row :] = [""]
            else:
                self.lines[self._row] = part
                assert len(part) < 80

    @property
    def shown(self) -> list[str]:
        return self.lines[:-1]


def test_status_lines_are_rewritten_below_what_was_said(monkeypatch):
    monkeypatch.setattr(screen.sys, "stdout", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(screen, "PERIOD", 0.0)
    seen = Lines()
    shown = screen.Screen(cast(Output, seen), ["anna", "bert"])
    shown.say("both answer")
    shown.line("anna", "1")
    shown.draw()
    assert seen.shown == ["both answer", "anna  1", "bert  "]
    shown.line("bert", "2")
    shown.line("anna", "x" * 100)
    shown.draw()
    assert seen.shown == ["both answer", "anna  " + "x" * 73, "bert  2"]
    shown.say("bert: ended")
    assert seen.shown == ["both answer", "bert: ended"]
    shown.draw()
    shown.draw()
    assert seen.shown == ["both answer", "bert: ended", "anna  " + "x" * 73, "bert  2"]


def test_without_a_terminal_each_robot_has_a_line_now_and_then(monkeypatch):
    monkeypatch.setattr(screen.sys, "stdout", SimpleNamespace(isatty=lambda: False))
    seen = Lines()
    shown = screen.Screen(cast(Output, seen), ["anna", "bert"])
    for number in range(5):
        shown.line("anna", str(number))
        shown.line("bert", str(number))
        shown.draw()
    assert seen.shown == ["anna  0", "bert  0"]
    monkeypatch.setattr(screen, "QUIET_PERIOD", 0.0)
    shown.line("anna", "9")
    assert seen.shown[2:] == ["anna  9"]


# as planned


@pytest.mark.slow
def test_ten_robots_and_one_key(kinematic, tmp_path):
    log = tmp_path / "log"
    with (
        robots(kinematic, tmp_path, *[""] * 10) as there,
        on_a_terminal(command(there, log, "--seconds", "600")) as (process, terminal),
    ):
        wait_for(lambda: "All 10 robots answer" in terminal.shown, "all answered")
        # nobody drives before a person says so
        time.sleep(0.7)
        assert all(emulator.body.standing for emulator in there.values())
        terminal.press(b"\n")
        wait_for(lambda: all_move(there), "all drove")
        time.sleep(4)
        assert all_move(there)
        terminal.press(b"q")
        assert slowest_stop(there) < STANDS
        _, error = process.communicate(timeout=PATIENCE)
        assert (process.returncode, error) == (0, "")
    assert "stopped by the operator's key; all robots stand still" in terminal.shown
    late = re.findall(r"robot-\d+: (\d+) control steps, (\d+) too long", terminal.shown)
    assert len(late) == 10
    for n_steps, n_late in late:
        assert int(n_steps) > 30
        # none on an idle machine; ten robots and this test share this one
        assert int(n_late) <= int(n_steps) / 3
    for number in range(1, 11):
        assert driven(log, f"robot-{number}").steps > 30


@pytest.mark.slow
def test_a_fleet_of_a_file_on_ptys(kinematic, tmp_path):
    """Each robot has its own controller and calibration; time ends all of them."""
    Calibration(track=0.06).save(tmp_path / "anna.yaml")
    run = tmp_path / "run"
    run.mkdir()
    (run / "champion.json").write_text(CHAMPION.read_text())
    log = tmp_path / "log"
    with robots(kinematic, tmp_path, "", "", kind="pty") as there:
        anna, bert = there
        (tmp_path / "fleet.yaml").write_text(
            f"anna: {{port: {anna}, controller: {run}, calibration: "
            f"{tmp_path}/anna.yaml}}\nbert: {{port: {bert}, controller: wall-follower}}"
        )
        done = ended(
            [
                *("-W", "error", "-m", "epuck_mj.bridge", "--log", str(log)),
                *("--fleet", str(tmp_path / "fleet.yaml"), "--seconds", "2"),
                *("--calibrate", "--max-speed", "0.05"),
            ]
        )
        assert all(emulator.body.standing for emulator in there.values())
    assert (done.returncode, done.stderr) == (0, "")
    assert f"anna at {anna}: Version 1.2.2" in done.stdout
    assert "bert: calibrated\n" in done.stdout
    assert "ended; all robots stand still\n" in done.stdout
    assert "anna: 20 control steps, " in done.stdout
    assert driven(log, "anna").hidden.shape == (20, 4)
    assert driven(log, "bert").hidden.shape == (20, 0)
    for name in ("anna", "bert"):
        fastest = np.abs(driven(log, name).command).max() * WHEEL_RADIUS
        assert 0 < fastest < 0.05 + 0.001
        for ending in (".png", ".rrd"):
            assert (log / f"{name}{ending}").stat().st_size > 1000


def ended(arguments: list[str]):
    """A fleet without a terminal, from start to end."""
    return subprocess.run(
        [sys.executable, *arguments],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


@pytest.mark.slow
def test_a_dry_run(kinematic, tmp_path):
    with robots(kinematic, tmp_path, "", "") as there:
        done = ended(command(there, tmp_path, "--seconds", "1", "--dry-run"))
        assert not any(ever_drove(emulator) for emulator in there.values())
    assert (done.returncode, done.stderr) == (0, "")


# before they drive


@pytest.mark.slow
def test_all_robots_that_do_not_answer_are_named_together(kinematic, tmp_path):
    """And nobody drives."""
    with robots(kinematic, tmp_path, "", "gone@0") as there:
        there_and_gone = list(there)
        ports = ["socket://127.0.0.1:1", *there_and_gone, str(tmp_path / "no")]
        done = ended(command(ports, tmp_path / "log"))
        assert not any(ever_drove(emulator) for emulator in there.values())
    assert done.returncode == 2
    refused, gone, missing = done.stderr.splitlines()
    assert refused.startswith("error: robot-1: cannot open port 'socket://127.0.0.1:1'")
    assert gone.startswith(
        "error: robot-3: the connection to the robot was lost. Is it"
    )
    assert missing.startswith(f"error: robot-4: no port '{tmp_path}/no'; available: ")
    assert f"robot-2 at {there_and_gone[0]}: Version" in done.stdout
    assert "no robot was driven\n" in done.stdout
    assert not (tmp_path / "log").exists()


@pytest.mark.slow
def test_a_robot_that_goes_while_a_person_is_asked(kinematic, tmp_path):
    with (
        robots(kinematic, tmp_path, "", "") as there,
        on_a_terminal(command(there, tmp_path)) as (process, terminal),
    ):
        wait_for(lambda: "All 2 robots answer" in terminal.shown, "all answered")
        befall(list(there.values())[1], "reset@{}")
        _, error = process.communicate(timeout=PATIENCE)
        assert process.returncode == 2
        assert not any(ever_drove(emulator) for emulator in there.values())
    assert re.match(r"error: robot-2: the robot .*\n$", error)


@pytest.mark.slow
@pytest.mark.usefixtures("handlers")
def test_a_robot_whose_process_does_not_get_on(
    kinematic, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(fleet_drive, "MEETING_TIME_MAX", 5.0)
    monkeypatch.setattr(crew.Crew, "_hear", deaf_to("robot-2", crew.Crew._hear))
    with robots(kinematic, tmp_path, "", "") as there:
        log = ("--log", str(tmp_path / "log"))
        asked = [part for port in there for part in ("--port", port)]
        assert bridge(["wall-follower", *asked, *log]) == 2
        assert not any(ever_drove(emulator) for emulator in there.values())
    error = capsys.readouterr().err
    assert error == "error: robot-2: not met in 5 s, and given up\n"


def deaf_to(name, hear):
    """What hears of a robot only when its driver has ended."""

    def hear_late(self, whose, process):
        if whose == name:
            process.wait()
        hear(self, whose, process)

    return hear_late


@pytest.mark.slow
def test_nobody_wants_to_start(kinematic, tmp_path):
    with (
        robots(kinematic, tmp_path, "", "") as there,
        on_a_terminal(command(there, tmp_path)) as (process, terminal),
    ):
        wait_for(lambda: "All 2 robots answer" in terminal.shown, "all answered")
        terminal.press(b"q")
        _, error = process.communicate(timeout=PATIENCE)
    assert (process.returncode, error) == (0, "")
    assert "no robot was driven" in terminal.shown


# one ends alone


@pytest.mark.parametrize(
    ("status", "alone", "failed"),
    [
        (0, True, False),
        (3, True, True),
        # somebody else stopped it
        (143, True, True),
        (143, False, False),
        (0, False, False),
        # as all were stopped
        (3, False, True),
        (4, False, True),
    ],
)
def test_ends_that_are_failures(status, alone, failed):
    assert fleet_drive.End(status, "", "", alone).failed == failed


@pytest.mark.slow
@pytest.mark.usefixtures("handlers")
def test_a_picture_that_cannot_be_written(kinematic, tmp_path, monkeypatch, capsys):
    """The logs are written, all other pictures, too, and it is said."""
    drawn = []

    def save_pictures(name, *_):
        if name.name == "robot-1":
            raise UserError("the disk is full")
        drawn.append(name.name)
        return []

    instead = SimpleNamespace(save_pictures=save_pictures)
    monkeypatch.setitem(sys.modules, "epuck_mj.bridge.drive.pictures", instead)
    log = tmp_path / "log"
    with robots(kinematic, tmp_path, "", "") as there:
        asked = [part for port in there for part in ("--port", port)]
        arguments = ["wall-follower", *asked, "--log", str(log), "--seconds", "1"]
        with pytest.raises(UserError, match=r"the disk is full; '.*robot-1\.npz' was"):
            bridge(arguments)
    assert drawn == ["robot-2"]
    assert driven(log, "robot-1").steps == driven(log, "robot-2").steps == 10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("faults", "status"),
    [(["disconnect@{}+0.4", "stall@{}+0.6"], 3), (["gone@{}"], 4)],
)
def test_robots_that_fail_stop_alone(kinematic, tmp_path, faults, status):
    log, last = tmp_path / "log", f"robot-{len(faults) + 2}"
    # a machine so busy that others stopped as well gets more chances
    for chance in (3, 2, 1):
        with (
            robots(kinematic, tmp_path, "", *[""] * len(faults), "") as there,
            python_process(*command(there, log, "--seconds", "3")) as process,
        ):
            wait_for(lambda there=there: all_move(there), "all drove")
            emulators = list(there.values())
            # for a few control steps
            time.sleep(1)
            for emulator, fault in zip(emulators[1:-1], faults, strict=True):
                befall(emulator, fault)
            out, error = process.communicate(timeout=PATIENCE)
            first, *failed, third = (each.body.standing for each in emulators)
            assert first and third
            assert failed == [status != 4] * len(faults)
        if chance == 1 or error.count("error: ") == len(faults):
            break
    assert process.returncode == status
    assert driven(log, "robot-1").steps == driven(log, last).steps == 30
    lines = error.splitlines()
    for number, (line, fault) in enumerate(zip(lines, faults, strict=True), start=2):
        assert line.startswith(f"error: robot-{number}: {FAULTS[fault]}")
        # it is said at once, and the others drive on
        assert f"robot-{number}: error: " in out.partition(f"{last}: ended")[0]
        assert 0 < driven(log, f"robot-{number}").steps < 25


def drivers(parent: int) -> list[int]:
    """Process ids of the drivers of a fleet, in the order of its robots."""
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            words = (entry / "cmdline").read_bytes().split(b"\0")
            status = (entry / "stat").read_text().rpartition(")")[2].split()
            if MODULE.encode() in words and int(status[1]) == parent:
                found.append(int(entry.name))
    return sorted(found)


needs_proc = pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="finds processes in /proc"
)


@needs_proc
@pytest.mark.slow
def test_a_driver_that_is_killed(kinematic, tmp_path):
    """Its guardian stops its robot; the other drives on."""
    with (
        robots(kinematic, tmp_path, "", "") as there,
        python_process(*command(there, tmp_path / "log")) as process,
    ):
        wait_for(lambda: all_move(there), "all drove")
        _, second = drivers(process.pid)
        emulators = list(there.values())
        os.kill(second, signal.SIGKILL)
        killed = time.monotonic()
        wait_for(lambda: emulators[1].body.standing, "stood")
        assert time.monotonic() - killed < STANDS
        time.sleep(1)
        assert not emulators[0].body.standing
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=PATIENCE)
        assert all(emulator.body.standing for emulator in emulators)
    assert process.returncode == 4
    assert "error: robot-2: its process ended with status -9, and its guard" in error
    assert "SIGINT: ended, but a robot may still drive\n" in error


# all end


@pytest.mark.slow
@pytest.mark.parametrize(
    "signum", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP]
)
def test_signals(kinematic, tmp_path, signum):
    log = tmp_path / "log"
    with (
        robots(kinematic, tmp_path, "", "") as there,
        python_process(*command(there, log)) as process,
    ):
        wait_for(lambda: all_move(there), "all drove")
        process.send_signal(signum)
        assert slowest_stop(there) < STANDS
        _, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + signum
    assert error == (
        f"{signum.name}: stopped by {signum.name}; all robots stand still\n"
    )
    for number in (1, 2):
        assert driven(log, f"robot-{number}").steps >= 0


@pytest.mark.slow
def test_a_terminal_that_vanishes(kinematic, tmp_path):
    log = tmp_path / "log"
    with (
        robots(kinematic, tmp_path, "", "") as there,
        on_a_terminal(command(there, log)) as (process, terminal),
    ):
        wait_for(lambda: "All 2 robots answer" in terminal.shown, "all answered")
        terminal.press(b"\n")
        wait_for(lambda: all_move(there), "all drove")
        terminal.close()
        assert slowest_stop(there) < STANDS
        _, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert error == (
        "error: stopped by the loss of the terminal; all robots stand still\n"
    )
    assert driven(log, "robot-1").steps >= 0


@pytest.mark.slow
def test_a_reader_that_went_away(kinematic, tmp_path):
    with (
        robots(kinematic, tmp_path, "", "") as there,
        python_process(*command(there, tmp_path / "log")) as process,
    ):
        wait_for(lambda: all_move(there), "all drove")
        assert process.stdout is not None
        process.stdout.close()
        process.stdout = None
        process.wait(PATIENCE)
        assert process.returncode == 1
        assert all(emulator.body.standing for emulator in there.values())


@needs_proc
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["tcp", "pty"])
def test_a_fleet_that_is_killed(kinematic, tmp_path, kind):
    """`kill -9`: its drivers hear of it, stop their robots, and write their logs."""
    log = tmp_path / "log"
    with (
        robots(kinematic, tmp_path, *[""] * 3, kind=kind) as there,
        python_process(*command(there, log)) as process,
    ):
        wait_for(lambda: all_move(there), "all drove")
        left = drivers(process.pid)
        assert len(left) == 3
        process.kill()
        assert slowest_stop(there) < STANDS
        process.wait(PATIENCE)
        wait_for(lambda: not any(Path(f"/proc/{pid}").exists() for pid in left), "end")
    for number in range(1, 4):
        assert driven(log, f"robot-{number}").steps >= 0


@needs_proc
@pytest.mark.slow
def test_a_driver_that_hangs_is_killed(kinematic, tmp_path):
    """Its guardian stops its robot."""
    with (
        robots(kinematic, tmp_path, "", "") as there,
        python_process(*command(there, tmp_path / "log")) as process,
    ):
        wait_for(lambda: all_move(there), "all drove")
        os.kill(drivers(process.pid)[0], signal.SIGSTOP)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=PATIENCE)
        assert all(emulator.body.standing for emulator in there.values())
    assert process.returncode == 4
    assert "error: robot-1: its process ended with status -9, and its guardi" in error
