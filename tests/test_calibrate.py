"""`python -m epuck_mj.calibrate`: its arithmetic, and whole calibrations of fakes."""

import dataclasses
import math
import os
import pty
import re
import signal
import subprocess
import threading
import time
from contextlib import contextmanager

import mujoco
import numpy as np
import pytest

from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.fake.endpoints import Pty
from epuck_mj.bridge.fake.scenarios import scenario
from epuck_mj.bridge.fake.simulated_body import SimulatedBody
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_line import SerialLine
from epuck_mj.bridge.line.wifi_line import WifiLine
from epuck_mj.calibrate.__main__ import calibrate, calibrate_robot
from epuck_mj.calibrate.bench import N_TURNS
from epuck_mj.calibrate.fitting import (
    SATURATED,
    fit_gains,
    fit_track,
    fit_wheel_radii,
    peaks,
)
from epuck_mj.calibrate.guide import CLEARANCES, STEPS, table
from epuck_mj.constants import (
    BODY_RADIUS,
    N_PROXIMITY,
    PROXIMITY_ANGLES,
    PROXIMITY_COUNT_MAX,
    TRACK,
    WHEEL_RADIUS,
)
from epuck_mj.errors import UserError
from epuck_mj.rungs.disturbed import DisturbedRobots
from epuck_mj.rungs.kinematic.robots import KinematicRobots
from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import MODELS
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.disturbances import Noise, draw_calibrated
from epuck_mj.step.motors import STEP_ANGLE
from epuck_mj.step.sensors import counted, proximity
from tests.processes import PATIENCE, python_process
from tests.test_bridge import BUSY
from tests.test_fake import behind, living, wait_for
from tests.virtual_time import VirtualPort, VirtualTime

GAINS = np.array([0.62, 1.45, 0.9, 1.1, 0.75, 1.3, 1.0, 1.2])
RADII, OWN_TRACK = (0.01995, 0.02025), 0.0562
"""Of the wheels of a robot that is not as shipped [m]."""

CENTRE = (0.0, 0.0, 0.0)
WALL = 0.5
DISTANCES = np.array(CLEARANCES)


# arithmetic


def seen_on_a_turn(clearance, gains, noise, rng, spacing=1.0):
    """Yaw `(n,)` and counts `(n, 8)` of a robot that turns beside a straight wall."""
    yaw = np.radians(np.arange(0, 396, spacing))
    facing = np.cos(yaw[:, None] + np.radians(PROXIMITY_ANGLES))
    with np.errstate(divide="ignore"):
        distance = (BODY_RADIUS + clearance) / facing - BODY_RADIUS
    distance = np.where(facing > 0, distance, -1.0)
    deviations = noise * rng.standard_normal(distance.shape)
    return yaw, counted(distance, gains, deviations)


def test_gains_of_exact_peaks():
    for gains in (np.ones(N_PROXIMITY), GAINS, GAINS[::-1]):
        fit = fit_gains(DISTANCES, proximity(DISTANCES)[:, None] * gains)
        np.testing.assert_allclose(fit.gains, gains)
        np.testing.assert_allclose(fit.residuals, 0, atol=1e-12)
        assert fit.used.all()


@pytest.mark.parametrize("seed", range(5))
def test_gains_of_noisy_turns(seed):
    rng = np.random.default_rng(seed)
    gains = np.exp(rng.uniform(math.log(0.6), math.log(1.5), N_PROXIMITY))
    turns = [seen_on_a_turn(distance, gains, 1.0, rng) for distance in DISTANCES]
    fit = fit_gains(DISTANCES, np.array([peaks(*turn) for turn in turns]))
    np.testing.assert_allclose(fit.gains, gains, rtol=0.02)
    assert fit.residuals.max() < 0.04


def test_peaks_withstand_single_wrong_readings():
    rng = np.random.default_rng(0)
    yaw, counts = seen_on_a_turn(0.02, 1.0, 0.0, rng)
    right = peaks(yaw, counts)
    np.testing.assert_allclose(right, proximity(np.array(0.02)), rtol=0.01)
    for row in range(0, len(yaw), 40):
        counts[row] = PROXIMITY_COUNT_MAX
    np.testing.assert_allclose(peaks(yaw, counts), right, rtol=0.01)


def test_peaks_of_readings_too_few():
    yaw, counts = seen_on_a_turn(0.02, 1.0, 0.0, np.random.default_rng(0), 4.0)
    with pytest.raises(UserError, match=r"expected 3 readings in 6 degrees.*got 1"):
        peaks(yaw, counts)


def test_peaks_of_sensors_without_zero():
    yaw, counts = seen_on_a_turn(0.02, 1.0, 0.0, np.random.default_rng(0))
    counts[:, 3] += 80
    with pytest.raises(UserError, match="got 80 of ps3: the zero is not set"):
        peaks(yaw, counts)


def test_saturated_peaks_are_left_out():
    gains = np.array([1.0, 3.0, *np.ones(6)])
    counts = np.minimum(proximity(DISTANCES)[:, None] * gains, PROXIMITY_COUNT_MAX)
    fit = fit_gains(DISTANCES, counts)
    assert not fit.used[0, 1]
    np.testing.assert_allclose(fit.gains, gains)
    assert f"ps1 is saturated ({SATURATED} counts and more) at 10 mm: left out" in (
        table(counts, fit)
    )
    counts[:, 1] = PROXIMITY_COUNT_MAX
    with pytest.raises(UserError, match="got none of ps1"):
        fit_gains(DISTANCES, counts)


def test_sensors_that_do_not_follow_the_curve():
    counts = np.tile(proximity(DISTANCES)[:, None], N_PROXIMITY)
    # as if the robot had never been moved
    counts[:, 6] = counts[1, 6]
    fit = fit_gains(DISTANCES, counts)
    assert fit.residuals[6] > 0.8
    assert "warning: ps6 deviates by" in table(counts, fit)
    assert table(counts, fit).count("warning") == 1


@pytest.mark.parametrize("gain", [0.0, 0.19, 5.1])
def test_gains_that_no_robot_has(gain):
    counts = np.tile(proximity(DISTANCES)[:, None], N_PROXIMITY)
    counts[:, 4] = np.minimum(gain * counts[:, 4], SATURATED - 1)
    counts[:2, 4] *= gain < 1
    counts[:2, 4] += SATURATED * (gain > 1)
    with pytest.raises(UserError, match=r"the gain of ps4 from 0\.2 to 5, measured"):
        fit_gains(DISTANCES, counts)


@pytest.mark.parametrize(
    ("radius", "track"), [(WHEEL_RADIUS, TRACK), (0.0200, 0.0569), (0.0207, 0.051)]
)
def test_wheels(radius, track):
    length = 4000 * STEP_ANGLE * radius
    assert fit_wheel_radii(4000, length, 0.0, track) == pytest.approx((radius, radius))
    angle = math.radians(3 * 360 - 20)
    steps = angle * track / 2 / (STEP_ANGLE * radius)
    assert fit_track(steps, radius, angle) == pytest.approx(track)


@pytest.mark.parametrize(
    "radii", [(0.0205, 0.0205), (0.02, 0.0207), (0.0207, 0.02), (0.0195, 0.0215)]
)
def test_wheels_that_differ(radii):
    left, right = 4000 * STEP_ANGLE * np.array(radii)
    turn, radius = (right - left) / TRACK, (left + right) / 2
    # from here to the end of the arc, in small steps
    headings = np.linspace(0, turn, 100_001)
    x, y = radius * np.cos(headings).mean(), radius * np.sin(headings).mean()
    forward = x + BODY_RADIUS * (math.cos(turn) - 1)
    aside = y + BODY_RADIUS * math.sin(turn)
    assert fit_wheel_radii(4000, forward, aside, TRACK) == pytest.approx(radii)


def test_wheels_that_no_robot_has():
    message = r"radius of the left wheel from 15 to 25 mm, measured 10"
    with pytest.raises(UserError, match=message):
        fit_wheel_radii(1000, 0.063, 0.0, TRACK)
    with pytest.raises(UserError, match="radius of the right wheel from 15 to 25 mm"):
        fit_wheel_radii(4000, 0.6, 0.15, TRACK)
    with pytest.raises(UserError, match=r"a track from 45 to 65 mm, measured 106 mm"):
        fit_track(323, WHEEL_RADIUS, math.pi / 4)
    with pytest.raises(UserError, match="expected a turn to the left"):
        fit_track(323, WHEEL_RADIUS, -1.0)


def test_rays_are_shortest_where_a_wall_is_faced(wheels):
    data = mujoco.MjData(wheels.model)
    x = WALL - BODY_RADIUS - 0.02
    for yaw_wanted, number in zip(-np.radians(PROXIMITY_ANGLES), range(8), strict=True):
        distances = []
        for yaw in yaw_wanted + np.radians([-3, 0, 3]):
            data.qpos[:] = wheels.qpos(np.array([x, 0.0, yaw]))
            mujoco.mj_forward(wheels.model, data)
            distances.append(wheels.reading(data.sensordata).distance[number])
        assert distances[1] == pytest.approx(0.02, abs=1e-5)
        assert 0 < distances[0] - distances[1] < 1e-4
        assert 0 < distances[2] - distances[1] < 1e-4


# whole calibrations


class OwnWheels(KinematicRobots):
    """Kinematic robots with wheels of their own: told what moves shipped ones alike."""

    def step(self, command):
        left, right = (command * RADII).T
        ahead, aside = (left + right) / 2, (right - left) / OWN_TRACK * TRACK / 2
        shipped = np.stack([ahead - aside, ahead + aside], axis=-1)
        return super().step(shipped / WHEEL_RADIUS)


class Body(SimulatedBody):
    """An e-puck of its own: sensors with gains, offsets and noise; can be lifted."""

    gains = np.ones(N_PROXIMITY)
    offset = 0
    noise = 0.0

    def __init__(self, scene, start, now, own_wheels=False):
        self.lock = threading.Lock()
        self.rng = np.random.default_rng(0)
        super().__init__(scene, start, now)
        if own_wheels:
            self._robots = OwnWheels(dataclasses.replace(scene, n_substeps=1), 1)
            self._robots.reset(start[None])

    def advance(self, now):
        with self.lock:
            super().advance(now)

    def proximity(self):
        deviations = self.noise * self.rng.standard_normal(N_PROXIMITY)
        counts = counted(self._reading.distance[0], self.gains, deviations)
        return np.minimum(counts.astype(int) + self.offset, PROXIMITY_COUNT_MAX)

    def place(self, pose):
        with self.lock:
            self._reading = self._robots.reset(np.array([pose], float))
            self._note()


class Person:
    """Somebody who does what is asked, and whose ruler is exact."""

    def __init__(self, body, settle, turns=N_TURNS):
        self.body = body
        self.settle = settle
        self.turns = turns
        self.changes = {}
        self.asked = []

    def __call__(self, question):
        self.asked.append(question)
        print(question)
        for part, answers in self.changes.items():
            if part in question and answers:
                return answers.pop(0)()
        self.settle()
        if "m clear before" in question:
            self.mark((-0.3, 0.0, 0.0))
        elif "5 cm clear" in question or "20 cm clear around" in question:
            self.mark(CENTRE)
        elif found := re.search(r"(\d+) mm of air", question):
            self.at_wall(int(found[1]) / 1000)
        elif "To the left" in question:
            return str(1000 * (self.front() - self.start_front)[1])
        elif "in metres" in question:
            return str((self.front() - self.start_front)[0])
        elif "above 0" in question:
            yaw = np.unwrap([pose[2] for pose in self.body.journal.pose[self.since :]])
            return f"{math.degrees(yaw[-1] - yaw[0]) - self.turns * 360:.1f}"
        elif "[y/n]" in question:
            return "y"
        return ""

    def at_wall(self, clearance):
        self.mark((WALL - BODY_RADIUS - clearance, 0.05, 0.5))
        return ""

    def mark(self, pose):
        self.body.place(pose)
        self.settle()
        self.start_front, self.since = self.front(), len(self.body.journal.pose) - 1

    def front(self):
        x, y, yaw = self.body.pose
        return np.array((x, y)) + BODY_RADIUS * np.array((math.cos(yaw), math.sin(yaw)))


class World:
    """A fake robot and a person in virtual time."""

    def __init__(
        self,
        scene,
        gains=None,
        faults="",
        robot="asercom",
        latency=0.0,
        own_wheels=False,
    ):
        self.time, self.wifi = VirtualTime(), robot == "wifi"
        self.body = Body(scene, np.zeros(3), 0.0, own_wheels)
        if gains is not None:
            self.body.gains = gains
        self.time.carry(Emulator(self.body, robot, 0.0, scenario(faults), latency))
        self.time.sleep(3.0)
        self.person = Person(self.body, lambda: self.time.sleep(0.3))

    def connect(self):
        arguments = (lambda: VirtualPort(self.time), self.time.clock, self.time.sleep)
        return WifiLine(*arguments) if self.wifi else SerialLine(Link(*arguments))

    def calibrate(self, output, *steps, verbose=False):
        try:
            return calibrate_robot(
                steps or tuple(STEPS),
                output,
                self.connect,
                self.person,
                self.time.clock,
                self.time.sleep,
                verbose,
            )
        finally:
            self.time.sleep(0.1)


def changed_robot(folder):
    """The robot in MuJoCo with wheels of its own, in the square."""
    text = (MODELS / "epuck.xml").read_text()
    for name, side, radius in zip(("left", "right"), (1, -1), RADII, strict=True):
        for shipped, own in (
            (
                f'pos="0 {side * TRACK / 2:g} {WHEEL_RADIUS:g}"',
                f'pos="0 {side * OWN_TRACK / 2} {radius}"',
            ),
            (
                f'<geom name="wheel_{name}" class="epuck/wheel"',
                f'<geom name="wheel_{name}" class="epuck/wheel" '
                f'size="{radius} 0.0015 {radius}"',
            ),
        ):
            assert text.count(shipped) == 1
            text = text.replace(shipped, own)
    path = folder / "other.xml"
    path.write_text(text)
    return load_scene(str(path), "arena")


@pytest.fixture
def output(tmp_path):
    return tmp_path / "robot.yaml"


@pytest.mark.parametrize("robot", ["asercom", "wifi"])
def test_another_robot(kinematic, output, robot, capsys):
    world = World(kinematic, GAINS, robot=robot, own_wheels=True)
    world.body.offset, world.body.noise = 60, 1.0
    assert world.calibrate(output) == 0
    found = Calibration.load(output)
    assert found.wheel_radii == pytest.approx(RADII, rel=0.002)
    assert found.track == pytest.approx(OWN_TRACK, rel=0.002)
    # on wheels that differ, the axle's middle circles while the robot turns
    np.testing.assert_allclose(found.gains, GAINS, rtol=0.04)
    assert world.body.standing
    out = capsys.readouterr().out
    assert "left wheel radius 19.96 mm; before 20.50" in out
    assert "left wheel radius 19.95 mm; before 19.96" in out
    assert "warning" not in out
    assert out.count(f"written: {output}") == 3


@pytest.mark.parametrize(
    ("robot", "latency", "steps"),
    [("btcom", 0.03, ("sensors",)), ("epuck2", 0.01, ("straight", "turn"))],
)
def test_other_firmware_on_a_slow_line(kinematic, output, robot, latency, steps):
    """They set their zero in ways of their own; what they count is the same."""
    world = World(kinematic, GAINS, robot=robot, latency=latency, own_wheels=True)
    world.body.offset, world.body.noise = 60, 1.0
    if "straight" not in steps:
        Calibration(wheel_radii=RADII, track=OWN_TRACK).save(output)
    assert world.calibrate(output, *steps) == 0
    found = Calibration.load(output)
    assert found.wheel_radii == pytest.approx(RADII, rel=0.002)
    assert found.track == pytest.approx(OWN_TRACK, rel=0.002)
    if "sensors" in steps:
        np.testing.assert_allclose(found.gains, GAINS, rtol=0.04)
    assert world.body.standing


def test_a_robot_on_wheels(output):
    """Its tyres creep: the radius on which it rolls is a little less."""
    world = World(load_scene("epuck", "arena"), GAINS)
    assert world.calibrate(output) == 0
    found = Calibration.load(output)
    assert found.wheel_radius == pytest.approx(WHEEL_RADIUS, rel=0.01)
    assert found.track == pytest.approx(TRACK, rel=0.01)
    np.testing.assert_allclose(found.gains, GAINS, rtol=0.03)


def test_a_weak_sensor_is_no_reason_to_stop(kinematic, output, capsys):
    world = World(kinematic)
    moved = iter([0.02, 0.02, 0.02])
    world.person.changes = {
        "mm of air": [lambda: world.person.at_wall(next(moved))] * 3
    }
    assert world.calibrate(output, "sensors") == 0
    assert capsys.readouterr().out.count("warning: ps") == N_PROXIMITY


def test_one_step_keeps_what_the_others_found(kinematic, output):
    before = Calibration(tuple(GAINS.tolist()), (0.0203, 0.0203), 0.0555)
    before.save(output)
    assert World(kinematic).calibrate(output, "turn") == 0
    found = Calibration.load(output)
    assert found.track == pytest.approx(TRACK * 0.0203 / WHEEL_RADIUS, rel=0.002)
    assert dataclasses.replace(found, track=0.0555) == before


# answers


def test_bad_answers_are_asked_again(kinematic, output, capsys):
    world = World(kinematic)
    # a comma is as good as a point
    answers = ["", "half a metre", "51.5", "nan", "-0.5", "0,515"]
    world.person.changes = {"metres": [lambda: answers.pop(0)] * len(answers)}
    assert world.calibrate(output, "straight") == 0
    out = capsys.readouterr().out
    assert "expected a number from 0.05 to 2, got '51.5'" in out
    assert out.count("expected a number") == 5
    found = Calibration.load(output)
    assert found.wheel_radius == pytest.approx(WHEEL_RADIUS, rel=0.002)
    world.person.changes = {"[y/n]": [lambda: "perhaps"], "mm of air": [end_of_input]}
    with pytest.raises(UserError, match="got the end of the input"):
        world.calibrate(output, "sensors")
    assert "expected y or n, got 'perhaps'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("steps", "part", "answer", "message"),
    [
        (("straight",), "metres", "1.5", "the left wheel from 15 to 25 mm, measured"),
        (("turn",), "above 0", "-300", "a track from 45 to 65 mm, measured 76.2 mm"),
        (("sensors",), "[y/n]", "n", "got 60 of ps0: the zero is not set"),
    ],
)
def test_what_no_robot_has_is_refused(kinematic, output, steps, part, answer, message):
    Calibration(track=0.055, wheel_radii=(0.0204, 0.0203)).save(output)
    before = output.read_bytes()
    world = World(kinematic)
    world.body.offset = 60
    world.person.changes = {part: [lambda: answer]}
    with pytest.raises(UserError, match=message) as caught:
        world.calibrate(output, *steps)
    assert "\n" not in str(caught.value)
    assert output.read_bytes() == before
    assert world.body.standing


def end_of_input():
    raise EOFError


@pytest.mark.parametrize(
    ("steps", "part"),
    [
        ((), "m clear before"),
        ((), "metres"),
        (("turn", "sensors"), "[y/n]"),
        (("turn", "sensors"), "mm of air"),
    ],
)
def test_the_end_of_the_input(kinematic, output, steps, part):
    world = World(kinematic)
    world.person.changes = {part: [end_of_input]}
    with pytest.raises(UserError, match="got the end of the input") as caught:
        world.calibrate(output, *steps)
    assert "\n" not in str(caught.value)
    assert world.body.standing
    # steps that were done are not lost
    assert output.exists() == ("turn" in steps)


# what goes wrong on the way


@pytest.mark.parametrize("step", list(STEPS))
@pytest.mark.parametrize(
    ("faults", "status", "message"),
    [
        ("stall@4", 3, "the robot did not answer for 0.3 s, so it was stopped and"),
        ("reset@4", 3, "the robot "),
        ("disconnect@4+0.5", 3, "the connection to the robot was lost, so it was"),
        ("gone@4", 4, "THE MOTORS MAY STILL TURN, switch the robot off"),
    ],
)
def test_faults(kinematic, output, capsys, step, faults, status, message):
    world = World(kinematic, faults=faults)
    world.person.changes = {"[y/n]": [lambda: "n"]}
    assert world.calibrate(output, step) == status
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert world.body.standing == (status != 4)
    assert not output.exists()


def test_a_robot_that_stalls_its_motors(kinematic, output, capsys, monkeypatch):
    world = World(kinematic)
    monkeypatch.setattr(world.body, "steps", lambda: (0, 0))
    assert world.calibrate(output, "straight", verbose=True) == 3
    error = capsys.readouterr().err
    assert "the motors turned too slowly, or not at all, so it was stopped" in error
    assert "Details: expected 4000 steps in 32 s; got 0" in error
    assert world.body.standing


def test_a_signal_while_it_drives(kinematic, output, capsys, handlers, monkeypatch):
    world = World(kinematic)
    sleep = world.time.sleep

    def interrupted(duration):
        if not world.body.standing:
            signal.raise_signal(signal.SIGINT)
        sleep(duration)

    monkeypatch.setattr(world.time, "sleep", interrupted)
    assert world.calibrate(output) == 130
    assert world.body.standing
    assert capsys.readouterr().err == "SIGINT: ended, the robot stands still\n"
    assert not output.exists()


def test_a_signal_at_a_question(kinematic, output, handlers):
    world = World(kinematic)
    world.person.changes = {"before": [lambda: signal.raise_signal(signal.SIGTERM)]}
    assert world.calibrate(output) == 128 + signal.SIGTERM


# the command line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "expected --port"),
        (["--port", "/dev/nope"], "no port '/dev/nope'; available"),
        (["--port", "/dev/null"], "is not a serial port"),
        (["--port", "x", "--only", "arms"], "arms"),
        (["--port", "x", "--output", "."], "cannot write '.': it is a folder"),
        (["--port", "x", "--output", "no/robot.yaml"], "no folder 'no'"),
        (["--port", "x", "--output", "hello.yaml"], "is not a calibration"),
        (["--port", "x", "--nonsense"], "nonsense"),
    ],
)
def test_bad_input(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hello.yaml").write_text("hello: 1")
    with pytest.raises(UserError, match=message) as caught:
        calibrate(arguments, lambda _: "")
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["hello.yaml"]


SPEED = 2.25
"""Of the emulated robot's time."""

SHORT = """
from epuck_mj.calibrate import bench, guide
from epuck_mj.calibrate.__main__ import calibrate
from epuck_mj.host.command_line import main

bench.N_STEPS = guide.N_STEPS = 1500
bench.N_TURNS = guide.N_TURNS = 1
guide.CLEARANCES = (0.010, 0.020)
main(calibrate)
"""
"""The command on ways that take it seconds instead of a minute."""


def clock():
    return SPEED * time.monotonic()


@contextmanager
def own_robot(endpoint, scene):
    """A robot of its own behind an endpoint, faster than real."""
    body = Body(scene, np.zeros(3), clock(), own_wheels=True)
    body.gains, body.offset = GAINS, 40
    with behind(endpoint, Emulator(body, "asercom", clock()), clock):
        yield body


def started(
    port, output, stdin: int = subprocess.PIPE, command=("-m", "epuck_mj.calibrate")
):
    """A calibration that is under way; killed if it hangs."""
    arguments = ("--port", str(port), "--output", str(output))
    return python_process("-W", "error", *command, *arguments, stdin=stdin)


def answered(process, person):
    """What a calibration says, answered until it ends."""
    said = question = ""
    while data := os.read(process.stdout.fileno(), 1000).decode():
        said, question = said + data, question + data
        if question.endswith(": "):
            process.stdin.write(f"{person(question)}\n")
            process.stdin.flush()
            question = ""
    return said


@pytest.mark.slow
def test_the_whole_command(kinematic, tmp_path, output):
    port = Pty(tmp_path / "e-puck")
    with own_robot(port, kinematic) as body:
        # a machine so busy that the watchdog saw it gets more chances
        for chance in (3, 2, 1):
            person = Person(body, lambda: time.sleep(0.1), turns=1)
            with started(port.name, output, command=("-c", SHORT)) as process:
                said = answered(process, person)
                _, error = process.communicate(timeout=PATIENCE)
            assert body.standing
            if chance == 1 or not re.search(BUSY, error):
                assert (process.returncode, error) == (0, "")
                assert "residual" in said
                break
    found = Calibration.load(output)
    assert found.wheel_radii == pytest.approx(RADII, rel=0.005)
    assert found.track == pytest.approx(OWN_TRACK, rel=0.01)
    # turns of a busy machine have fewer readings; see test_another_robot
    np.testing.assert_allclose(found.gains, GAINS, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_signals(kinematic, tmp_path, output, signum):
    port = Pty(tmp_path / "e-puck")
    with (
        living(port, kinematic) as emulator,
        started(port.name, output) as process,
    ):
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
        wait_for(lambda: not emulator.body.standing, "drove")
        process.send_signal(signum)
        _, error = process.communicate(timeout=PATIENCE)
        assert process.returncode == 128 + signum
        assert emulator.body.standing
    assert error == f"{signum.name}: ended, the robot stands still\n"
    assert not output.exists()


@pytest.mark.slow
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGHUP])
def test_signals_at_a_terminals_question(kinematic, tmp_path, output, signum):
    master, slave = pty.openpty()
    port = Pty(tmp_path / "e-puck")
    try:
        with (
            living(port, kinematic),
            started(port.name, output, stdin=slave) as process,
        ):
            assert process.stdout is not None
            while not (line := process.stdout.readline()).startswith("Mark where"):
                assert line
            time.sleep(0.3)
            process.send_signal(signum)
            _, error = process.communicate(timeout=PATIENCE)
    finally:
        os.close(master)
        os.close(slave)
    assert process.returncode == 128 + signum
    assert error.startswith(f"{signum.name}: ended")


@pytest.mark.slow
def test_nobody_answers(kinematic, tmp_path, output):
    port = Pty(tmp_path / "e-puck")
    with (
        living(port, kinematic),
        started(port.name, output) as process,
    ):
        _, error = process.communicate("", timeout=PATIENCE)
    assert process.returncode == 2
    assert error == (
        "error: expected an answer to 'Then press Enter', got the end of the input\n"
    )


def test_without_a_robot_nobody_is_asked_anything(output):
    asked: list[str] = []

    def ask(question: str) -> str:
        asked.append(question)
        return ""

    with pytest.raises(UserError, match="nowhere"):
        calibrate(["--port", "/dev/nowhere", "--output", str(output)], ask)
    assert not asked
    assert not output.exists()


# what the file is for


def test_a_calibrated_robot_in_simulation(tmp_path, wheels):
    """It drives as the robot does whose wheels these really are."""
    calibration = Calibration(tuple(GAINS), RADII, OWN_TRACK)
    quiet = Noise(counts=0.0, wheels=0.0, age=0.0)
    rng = np.random.default_rng(0)
    disturbances = draw_calibrated(calibration, rng, 2, 20, quiet)
    robots = DisturbedRobots(MujocoRobots(wheels, 2, 1), disturbances, 0.1)
    other = MujocoRobots(changed_robot(tmp_path), 2, 1)
    starts = np.array([[0.3, 0.0, 1.0], [0.44, 0.1, 1.5]])
    reading, truth = robots.reset(starts), other.reset(starts)
    command = np.tile(np.array([200, 250]) * STEP_ANGLE, (2, 1))
    for _ in range(20):
        reading, truth = robots.step(command), other.step(command)
    np.testing.assert_allclose(robots.poses(), other.poses(), atol=1e-3)
    assert reading.truth is not None
    expected = np.rint(proximity(reading.truth, GAINS))
    np.testing.assert_array_equal(reading.proximity, expected)
    # what they count is read by somebody who knows their gains
    near = reading.truth < 0.05
    assert near.any()
    np.testing.assert_allclose(reading.distance[near], truth.distance[near], atol=0.003)
