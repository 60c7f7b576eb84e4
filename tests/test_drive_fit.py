"""`python -m epuck_mj.calibrate fit`: robots found again in logs of their drives.

The robots are emulated, in virtual time, with wheels, delays and sensors of their own.
"""

import contextlib
import dataclasses
import io
from collections import deque
from functools import cache

import numpy as np
import pytest

from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Session
from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.fake.simulated_body import SimulatedBody
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_line import SerialLine
from epuck_mj.calibrate.__main__ import calibrate
from epuck_mj.calibrate.command_delay import fit_delay, lagged_rates, told_steps
from epuck_mj.calibrate.drive_fit import ERRORS_MAX, fit_drive, without_spikes
from epuck_mj.calibrate.drive_model import SIGHT, DriveModel, curve
from epuck_mj.calibrate.normal_equations import Normal
from epuck_mj.calibrate.parameters import (
    GAINS,
    LAG,
    N_PARAMETERS,
    OWN_TRACK,
    RIGHT,
    parameters_of,
)
from epuck_mj.calibrate.recorded_drive import RecordedDrive, load_drive
from epuck_mj.calibrate.smoothing import CAUCHY, HUBER
from epuck_mj.constants import N_PROXIMITY, PROXIMITY_COUNT_MAX, TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.disturbed import DisturbedRobots
from epuck_mj.rungs.kinematic.plan import plan_of
from epuck_mj.rungs.kinematic.robots import KinematicRobots
from epuck_mj.scene.model import load_scene
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.disturbances import RANGES, Noise, draw_calibrated
from epuck_mj.step.motors import actual_rates, command, step_rates
from epuck_mj.step.sensors import counted, observe, proximity
from epuck_mj.trials.trajectory import Trajectory
from tests.virtual_time import VirtualPort, VirtualTime

CONTROL_STEP = 0.1
START = (0.1, -0.2, 0.7)
IDEAL = Calibration()


class OwnWheels(KinematicRobots):
    """Kinematic robots with a calibration of their own."""

    def __init__(self, scene, own):
        super().__init__(scene, 1)
        self._own = own
        self.embody(dataclasses.replace(Bodies.own(1), lag=np.full(1, own.lag)))

    def step(self, command):
        left, right = (command * self._own.wheel_radii).T
        ahead, aside = (left + right) / 2, (right - left) / self._own.track * TRACK / 2
        shipped = np.stack([ahead - aside, ahead + aside], axis=-1)
        return super().step(shipped / WHEEL_RADIUS)


class OwnBody(SimulatedBody):
    """An e-puck of its own, whose motors hear of commands some control steps late."""

    def __init__(self, scene, start, own, noise, seed):
        self._own, self._noise = own, noise
        self._rng = np.random.default_rng(seed)
        self._on_the_way = deque()
        super().__init__(scene, start, 0.0)
        self._robots = OwnWheels(dataclasses.replace(scene, n_substeps=1), own)
        self._reading = self._robots.reset(start[None])

    def drive(self, left, right):
        late = CONTROL_STEP * self._own.latency
        self._on_the_way.append((self._now + late, left, right))

    def advance(self, now):
        while self._on_the_way and self._on_the_way[0][0] <= now:
            time, left, right = self._on_the_way.popleft()
            super().advance(time)
            super().drive(left, right)
        super().advance(now)

    def proximity(self):
        deviations = self._noise * self._rng.standard_normal(N_PROXIMITY)
        distance = self._reading.distance[0]
        return counted(distance, self._own.gains, deviations).astype(int)


@cache
def scene_of(physics_step=None, arena="arena"):
    return load_scene("epuck_kinematic", arena, CONTROL_STEP, physics_step)


def driven(
    own, seconds=40, policy=None, start=START, said=None, noise=1.0, seed=0
) -> Trajectory:
    """Log of an emulated robot's drive over the bridge.

    Its physics step is short: sensors are read and commands obeyed when they are.
    """
    time = VirtualTime()
    body = OwnBody(scene_of(0.002), np.array(start, float), own, noise, seed)
    time.carry(Emulator(body, "asercom", 0.0))
    time.sleep(1.0)
    line = SerialLine(Link(lambda: VirtualPort(time), time.clock, time.sleep))
    policy = policy or WallFollower()
    robot = RealRobot(
        line,
        IDEAL,
        CONTROL_STEP,
        start=start if said is None else said,
        clock=time.clock,
        sleep=time.sleep,
    )
    session = Session(TaskParameters(control_step=CONTROL_STEP))
    n_steps = round(seconds / CONTROL_STEP)
    with robot:
        robot.greet()
        for _ in session.drive(robot, policy, n_steps, time.clock):
            pass
    trajectory = session.trajectory(policy)
    assert trajectory is not None
    return trajectory


def drive_of(trajectory, folder, start=None) -> RecordedDrive:
    trajectory.save(folder / "drive.npz")
    return load_drive(folder / "drive.npz", start)


def found_in(trajectory, folder, known=IDEAL, start=None):
    return fit_drive(drive_of(trajectory, folder, start), scene_of(), known)


def another_robot(seed) -> Calibration:
    """A robot from the ranges in which robots differ."""
    rng = np.random.default_rng(seed)
    low, high = np.log(RANGES.gain)
    return Calibration(
        tuple(np.exp(rng.uniform(low, high, N_PROXIMITY)).tolist()),
        tuple(rng.uniform(*RANGES.wheel_radius, 2).tolist()),
        float(rng.uniform(*RANGES.track)),
        int(rng.integers(RANGES.latency[0], RANGES.latency[1] + 1)),
        float(rng.uniform(0.5, 2.0)),
    )


@pytest.fixture(scope="module")
def a_drive():
    """A drive of a robot of its own, and the robot."""
    own = another_robot(4)
    return driven(own), own


# robots found again


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_another_robot_is_found_again(seed, tmp_path):
    own = another_robot(seed)
    rng = np.random.default_rng(seed)
    said = np.array(START) + rng.standard_normal(3) * (0.005, 0.005, 0.05)
    fit = found_in(driven(own, said=said, seed=seed), tmp_path)
    found = fit.calibration
    assert found.latency == own.latency
    assert found.wheel_radii == pytest.approx(own.wheel_radii, rel=0.005)
    assert found.track == pytest.approx(own.track, rel=0.01)
    assert found.lag == pytest.approx(own.lag, rel=0.1)
    shown = fit.shown[GAINS]
    assert shown.sum() >= 6
    np.testing.assert_allclose(found.gains[shown], own.gains[shown], rtol=0.1)
    np.testing.assert_array_equal(found.gains[~shown], 1.0)
    # errors are what they say
    off = (parameters_of(found) - parameters_of(own))[fit.shown]
    assert np.abs(off / fit.errors[fit.shown]).max() < 5
    # how far it was from where it was put, a drive hardly shows
    assert np.hypot(*(fit.start - START)[:2]) < 0.02
    # and it explains the drive
    left = {each.name: each for each in fit.quantities}
    assert left["motor steps in a control step"].after < 3
    path = left["path by the counters alone"]
    # some of them touched walls
    assert 5 * path.after < path.before
    assert path.after < 25
    for i in np.flatnonzero(shown):
        sensor = left[f"distance by ps{i}"]
        assert sensor.after < 4
        assert sensor.n > 0


@pytest.mark.slow
def test_standard_errors_tell_how_far_off_fits_are(tmp_path):
    """Of robots that differ in their noise only."""
    own, ratios = another_robot(12), []
    for seed in range(4):
        fit = found_in(driven(own, seconds=20, seed=seed), tmp_path)
        off = parameters_of(fit.calibration) - parameters_of(own)
        ratios.append((off / np.maximum(fit.errors, 1e-9))[fit.shown])
    rms = np.sqrt((np.concatenate(ratios) ** 2).mean())
    assert 0.3 < rms < 2.5


def test_the_ideal_robot_is_found_to_be_ideal(tmp_path):
    fit = found_in(driven(IDEAL, 60), tmp_path)
    found = fit.calibration
    assert found.latency == 0
    assert found.wheel_radii == pytest.approx(IDEAL.wheel_radii, rel=0.001)
    assert found.track == pytest.approx(IDEAL.track, rel=0.003)
    assert found.lag == pytest.approx(1, rel=0.1)
    np.testing.assert_allclose(found.gains, 1, rtol=0.05)
    for each in fit.quantities:
        if each.unit == "mm" and each.n:
            assert each.before < 5


def test_a_start_that_is_a_little_off(a_drive, tmp_path):
    trajectory, own = a_drive
    off = np.add(START, (0.02, -0.02, 0.1))
    fit = found_in(trajectory, tmp_path, start=off)
    np.testing.assert_allclose(fit.start, START, atol=0.02)
    assert fit.calibration.wheel_radii == pytest.approx(own.wheel_radii, rel=0.005)
    assert fit.calibration.track == pytest.approx(own.track, rel=0.01)


def test_saturated_readings_without_a_wall_are_left_out():
    wall = [0, 500, 4000, 4095, 4095, 4095, 4000, 500, 0]
    spikes = [0, 20, 4095, 0, 4095, 4095, 0, 100, 4095]
    gap = [np.nan, 4095, np.nan, 10, 10, np.nan, np.nan, 4095, np.nan]
    counts = np.array([wall, spikes, gap], float).T
    kept = without_spikes(counts)
    np.testing.assert_array_equal(kept[:, 0], wall)
    assert np.isnan(kept[:, 1]).nonzero()[0].tolist() == [2, 4, 5, 8]
    # where nothing is known around it, it stays
    assert np.isnan(kept[:, 2]).nonzero()[0].tolist() == [0, 1, 2, 5, 6, 8]


@pytest.mark.parametrize("seed", [4, 5])
def test_wrong_missing_and_saturated_readings(tmp_path, seed):
    own = another_robot(seed)
    # a shorter drive is not enough
    trajectory = driven(own, 60)
    rng = np.random.default_rng(0)
    counts = trajectory.proximity.copy()
    counts[rng.random(counts.shape) < 0.02] = PROXIMITY_COUNT_MAX
    counts[rng.random(counts.shape) < 0.02] = 0
    counts[rng.random(counts.shape) < 0.05] = np.nan
    counts[100:120] = np.nan
    fit = found_in(dataclasses.replace(trajectory, proximity=counts), tmp_path)
    assert fit.calibration.wheel_radii == pytest.approx(own.wheel_radii, rel=0.005)
    assert fit.calibration.track == pytest.approx(own.track, rel=0.01)
    shown = fit.shown[GAINS]
    found = fit.calibration.gains[shown]
    np.testing.assert_allclose(found, own.gains[shown], rtol=0.1)


def simulated(own, noise, seed) -> RecordedDrive:
    """A drive in simulation whose wheels slip: a bridge's log would look like it."""
    n_steps = 400
    rng = np.random.default_rng(seed)
    met = draw_calibrated(own, rng, 1, n_steps, noise)
    robots = DisturbedRobots(KinematicRobots(scene_of(), 1), met, CONTROL_STEP)
    reading = robots.reset(np.array([START]))
    task, policy = TaskParameters(), WallFollower()
    assert reading.proximity is not None
    rates, counts, steps = [], [reading.proximity[0]], [np.zeros(2)]
    for _ in range(n_steps):
        seen = observe(reading.distance, task.sensor_range)
        wanted = command(policy(seen), task.speeds)
        rates.append(step_rates(wanted[0]))
        reading = robots.step(wanted)
        assert reading.proximity is not None
        counts.append(reading.proximity[0])
        steps.append(steps[-1] + actual_rates(rates[-1]) * CONTROL_STEP)
    time = np.arange(n_steps + 1) * CONTROL_STEP
    made = np.floor(np.array(steps) + 1e-9)
    return RecordedDrive(
        time, made, np.array(rates, float), np.array(counts), np.array(START)
    )


def test_wheels_that_slip():
    """They show less, and the fit says so."""
    own = dataclasses.replace(another_robot(4), latency=0)
    drive = simulated(own, Noise(counts=1.0, wheels=0.03), 4)
    fit = fit_drive(drive, scene_of(), IDEAL)
    assert 0.01 < fit.slip < 0.05
    assert fit.calibration.wheel_radii == pytest.approx(own.wheel_radii, rel=0.005)
    assert fit.calibration.track == pytest.approx(own.track, rel=0.025)
    assert fit.errors[OWN_TRACK] > 0.003


def test_more_of_a_drive_tells_more(a_drive, tmp_path):
    trajectory, _ = a_drive
    whole = found_in(trajectory, tmp_path)
    n = 200
    half = drive_of(trajectory, tmp_path)
    part = RecordedDrive(
        half.time[: n + 1], half.steps[: n + 1], half.rates[:n], half.counts[: n + 1],
        half.start,
    )  # fmt: skip
    less = fit_drive(part, scene_of(), IDEAL)
    assert (whole.errors[less.shown] < less.errors[less.shown]).all()


# drives that do not show everything


def ahead(speed, turn=0.0):
    return lambda observation: np.array([speed, turn])


KNOWN = Calibration((0.9,) * 8, (0.0202, 0.0203), 0.054, 0, 1.2)


def test_a_drive_away_from_walls_shows_the_delay_only(tmp_path):
    own = dataclasses.replace(another_robot(1), latency=2)
    trajectory = driven(own, 20, ahead(0.0, 0.5), start=(0.0, 0.0, 0.0))
    fit = found_in(trajectory, tmp_path, KNOWN)
    assert not fit.shown.any()
    assert fit.calibration == dataclasses.replace(KNOWN, latency=2)


def test_a_robot_that_turns_at_a_wall_shows_its_gains_but_no_wheels(tmp_path):
    own = another_robot(8)
    start = (0.44, 0.0, 0.0)
    fit = found_in(driven(own, 20, ahead(0.0, 0.5), start=start), tmp_path, KNOWN)
    assert fit.shown[GAINS].all()
    np.testing.assert_allclose(fit.calibration.gains, own.gains, rtol=0.1)
    assert not fit.shown[:2].any()
    assert fit.calibration.wheel_radii == KNOWN.wheel_radii


def test_a_straight_drive_shows_no_track(tmp_path):
    """It goes forth and back between two walls."""
    turns = iter(range(10_000))

    def back_and_forth(observation):
        return np.array([0.5 if next(turns) // 60 % 2 == 0 else -0.5, 0.0])

    start = (0.1, 0.0, 0.0)
    fit = found_in(driven(IDEAL, 40, back_and_forth, start=start), tmp_path, KNOWN)
    assert not fit.shown[OWN_TRACK]
    assert fit.calibration.track == pytest.approx(KNOWN.track)


def test_a_robot_that_stands_shows_nothing(tmp_path):
    trajectory = driven(another_robot(1), 10, ahead(0.0))
    message = r"drive shows nothing about the robot.*rolled 0\.00 m, and 0 readings"
    with pytest.raises(UserError, match=message):
        found_in(trajectory, tmp_path)


# its command line


def fitted(*arguments) -> str:
    """What the command prints; it must succeed."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert calibrate(["fit", *map(str, arguments)]) == 0
    return out.getvalue()


def test_the_command_writes_what_bridge_and_evolution_read(a_drive, tmp_path):
    trajectory, own = a_drive
    log, output = tmp_path / "drive.npz", tmp_path / "robot.yaml"
    trajectory.save(log)
    out = fitted(log, "--output", output)
    found = Calibration.load(output)
    assert found.track == pytest.approx(own.track, rel=0.01)
    assert f"written: {output}" in out
    assert "400 control steps of 100 ms" in out
    for name in ("left wheel radius", "track", "latency", "lag of", "gain of ps7"):
        assert name in out
    # the left side saw no wall, and what it was told stays
    assert "not shown: 0 readings near walls" in out
    assert "path by the counters alone" in out
    assert "warning" not in out
    # once more, from there: nothing changes by much
    again = fitted(log, "--output", output)
    assert "20.500" not in again
    assert Calibration.load(output).track == pytest.approx(found.track, rel=0.002)


def test_values_that_a_drive_does_not_show_stay_in_the_file(tmp_path):
    log, output = tmp_path / "drive.npz", tmp_path / "robot.yaml"
    driven(another_robot(1), 20, ahead(0.0, 0.5), start=(0.0, 0.0, 0.0)).save(log)
    KNOWN.save(output)
    out = fitted(log, "--output", output)
    assert out.count("kept  not shown") == 12
    assert "it turned" in out
    assert Calibration.load(output) == dataclasses.replace(
        KNOWN, latency=another_robot(1).latency
    )


def test_a_wrong_start_is_noticed(a_drive, tmp_path):
    trajectory, _ = a_drive
    log, output = tmp_path / "drive.npz", tmp_path / "robot.yaml"
    trajectory.save(log)
    arguments = ("--output", output, "--pose", 0, 0, 0)
    assert "or it started elsewhere (--pose)" in fitted(log, *arguments)


@pytest.mark.parametrize(
    ("arena", "message"),
    [
        ("small_square", "expected readings that fit the arena"),
        ("corridor", "expected readings that fit the arena|without jumps"),
        ("nowhere", "no arena 'nowhere'"),
    ],
)
def test_another_arena_is_refused(a_drive, tmp_path, arena, message):
    trajectory, _ = a_drive
    log, output = tmp_path / "drive.npz", tmp_path / "robot.yaml"
    trajectory.save(log)
    with pytest.raises(UserError, match=message) as caught:
        fitted(log, "--arena", arena, "--output", output)
    assert "\n" not in str(caught.value)
    assert not output.exists()


def test_an_arena_without_outlines_is_refused(a_drive, tmp_path):
    log, arena = tmp_path / "drive.npz", tmp_path / "leaning.xml"
    a_drive[0].save(log)
    leaning = '<geom type="cylinder" size="0.02 0.2" euler="30 0 0" pos="0.3 0 0"/>'
    floor = '<geom type="plane" size="1 1 0.1"/>'
    arena.write_text(f"<mujoco><worldbody>{floor}{leaning}</worldbody></mujoco>")
    with pytest.raises(UserError, match="a fit needs exact outlines") as caught:
        fitted(log, "--arena", arena, "--output", tmp_path / "robot.yaml")
    assert "--robot" not in str(caught.value)


def test_a_robot_that_no_e_puck_is(a_drive, tmp_path):
    """Half of the steps: its wheels would be twice as large."""
    trajectory, _ = a_drive
    assert trajectory.motor_steps is not None
    other = dataclasses.replace(trajectory, motor_steps=trajectory.motor_steps // 2)
    message = "not an e-puck|without jumps|radius of the left wheel"
    with pytest.raises(UserError, match=message):
        found_in(other, tmp_path)


def test_files_that_cannot_be_fitted_are_one_line(a_drive, tmp_path):
    trajectory, _ = a_drive
    log = tmp_path / "drive.npz"
    time = trajectory.time.copy()
    time[7] = time[6]
    assert trajectory.motor_steps is not None
    steps = trajectory.motor_steps.copy()
    steps[3, 1] = np.nan
    rows = {"time", "pose", "distance", "proximity", "observation", "contact"}
    rows |= {"motor_steps"}
    short = {
        field.name: getattr(trajectory, field.name)[: 20 + (field.name in rows)]
        for field in dataclasses.fields(trajectory)
    }
    for changes, message in (
        ({"motor_steps": None}, "has no motor_steps: expected the log of a drive"),
        ({"time": time}, "expected time that grows"),
        ({"motor_steps": steps}, "expected motor_steps that are finite"),
        ({"command": trajectory.command * np.nan}, "expected command that is finite"),
        (short, "expected at least 50 control steps, got 20"),
    ):
        dataclasses.replace(trajectory, **changes).save(log)
        with pytest.raises(UserError, match=message) as caught:
            fitted(log, "--output", tmp_path / "robot.yaml")
        assert "\n" not in str(caught.value)
    log.write_text("no archive")
    with pytest.raises(UserError, match=r"expected an \.npz archive"):
        fitted(log)
    np.savez(log, time=time)
    with pytest.raises(UserError, match="is not a trajectory file"):
        fitted(log)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "expected the log of a drive"),
        (["nothing.npz"], r"nothing\.npz"),
        (["a.npz", "--pose", "nan", "0", "0"], "expected --pose of finite numbers"),
        (["a.npz", "--output", "no/robot.yaml"], "cannot write .*no folder 'no'"),
        (["a.npz", "--port", "COM5"], "unknown option --port"),
    ],
)
def test_bad_input(arguments, message, alone):
    with pytest.raises(UserError, match=message) as caught:
        calibrate(["fit", *arguments])
    assert "\n" not in str(caught.value)


# its parts


@pytest.mark.parametrize("late", [0.0, 0.03, 0.1, 0.25])
def test_delays_of_commands(late):
    rng = np.random.default_rng(0)
    time = np.cumsum(np.r_[0.0, rng.uniform(0.09, 0.15, 200)])
    rates = rng.integers(-900, 900, (200, 2)).astype(float)
    told = RecordedDrive(
        time, np.zeros((201, 2)), rates, np.zeros((201, 8)), np.zeros(3)
    )
    steps = np.cumsum(np.r_[np.zeros((1, 2)), told_steps(told, late)], axis=0)
    # some were lost
    steps += np.cumsum(rng.random((201, 2)) < 0.02, axis=0) * 10
    delay = fit_delay(dataclasses.replace(told, steps=np.floor(steps)))
    assert delay.known
    assert delay.delay == pytest.approx(late, abs=0.001)
    assert delay.latency == round(late / told.control_step)


def test_commands_that_never_change_show_no_delay():
    time = np.arange(101) * CONTROL_STEP
    drive = RecordedDrive(
        time, np.zeros((101, 2)), np.zeros((100, 2)), np.zeros((101, 8)), np.zeros(3)
    )
    assert not fit_delay(drive).known


def test_lagged_rates_are_those_of_a_first_order_lag():
    rng = np.random.default_rng(1)
    time = np.cumsum(np.r_[0.0, rng.uniform(0.09, 0.12, 20)])
    rates = rng.integers(-900, 900, (20, 2)).astype(float)
    drive = RecordedDrive(
        time, np.zeros((21, 2)), rates, np.zeros((21, 8)), np.zeros(3)
    )
    found = lagged_rates(drive, 0.13, 0.02)
    # in small steps
    speed, tick, k = np.zeros(2), 2e-5, 0
    for now in np.arange(0, time[-1] + tick, tick):
        if k < len(time) and now >= time[k]:
            np.testing.assert_allclose(found[k], speed, atol=1.0)
            k += 1
        told = np.searchsorted(time[:-1] + 0.13, now, side="right") - 1
        goal = actual_rates(rates[told]) if told >= 0 else np.zeros(2)
        speed += (goal - speed) * tick / 0.02
    assert k >= len(time) - 1


def test_the_curve_is_that_of_the_sensors():
    distance = np.linspace(0, 0.08, 400)
    logs, slopes = curve(distance)
    np.testing.assert_allclose(np.exp(logs), proximity(distance))
    far = np.linspace(0.0803, 0.4, 50)
    ahead, _ = curve(far + 1e-7)
    behind, _ = curve(far - 1e-7)
    np.testing.assert_allclose((ahead - behind) / 2e-7, curve(far)[1], rtol=1e-3)
    assert (slopes < 0).all()


def test_slopes_are_those_of_the_residuals(a_drive, tmp_path):
    trajectory, own = a_drive
    n = 60
    drive = drive_of(trajectory, tmp_path)
    plan = plan_of(scene_of(), SIGHT, CONTROL_STEP)
    model = DriveModel(drive, plan, 0.004, 0.02, 0, len(drive.time) - 1)
    parameters = parameters_of(own)
    poses = model.path(np.array(START), parameters)[100 : 101 + n]
    model = model.part(100, 100 + n)
    poses += np.random.default_rng(0).normal(0, 1e-4, poses.shape)
    here = model.linearised(poses, parameters)
    nudge = 1e-6
    for axis in range(3):
        moved = poses.copy()
        moved[10, axis] += nudge
        there = model.linearised(moved, parameters)
        change = (there.motion - here.motion) / nudge
        size = np.abs(here.motion_to[..., axis]).max()
        np.testing.assert_allclose(
            change[9], here.motion_to[9, :, axis], atol=0.03 * size
        )
        np.testing.assert_allclose(
            change[10], here.motion_from[10, :, axis], atol=0.03 * size
        )
        assert not np.delete(change, (9, 10), axis=0).any()
    for number in (RIGHT, OWN_TRACK, LAG):
        other = parameters.copy()
        other[number] += nudge
        there = model.linearised(poses, other)
        change = (there.motion - here.motion) / nudge
        by = here.motion_parameters[..., number]
        # where paths differ from arcs is no matter of slopes
        np.testing.assert_allclose(change, by, atol=0.15 * np.abs(by).max())
    other = parameters.copy()
    other[GAINS] += nudge
    seen = here.seen != 0
    change = (model.linearised(poses, other).seen - here.seen)[seen] / nudge
    np.testing.assert_allclose(change, here.seen_gains[seen], rtol=0.05, atol=0.5)


def test_normal_equations_are_solved_as_dense_ones_are():
    rng = np.random.default_rng(0)
    n, f = 7, 4
    free = np.isin(np.arange(N_PARAMETERS), (0, 2, 5, 11))
    rows = [rng.standard_normal((3, 3 * n + f)) for _ in range(3 * n)]
    for k, row in enumerate(rows):
        # each meets two poses that follow one another, and the parameters
        first = 3 * min(k % n, n - 2)
        row[:, : 3 * n][:, np.r_[0:first, first + 6 : 3 * n]] = 0
    jacobian = np.concatenate(rows)
    left = rng.standard_normal(len(jacobian))
    whole, slope = jacobian.T @ jacobian, jacobian.T @ left
    blocks = whole[: 3 * n, : 3 * n].reshape(n, 3, n, 3)
    normal = Normal(
        diagonal=np.array([blocks[k, :, k] for k in range(n)]),
        beside=np.array([blocks[k, :, k + 1] for k in range(n - 1)]),
        border=whole[: 3 * n, 3 * n :],
        corner=whole[3 * n :, 3 * n :],
        pose_slope=slope[: 3 * n],
        slope=slope[3 * n :],
        free=free,
    )
    solution = normal.solved(0.0)
    expected = -np.linalg.solve(whole, slope)
    np.testing.assert_allclose(solution.pose_step.ravel(), expected[: 3 * n])
    np.testing.assert_allclose(solution.step[free], expected[3 * n :])
    assert not solution.step[~free].any()
    covariance = np.linalg.inv(whole)[3 * n :, 3 * n :]
    np.testing.assert_allclose(solution.errors[free], np.sqrt(np.diag(covariance)))
    expected = np.linalg.slogdet(whole)[1]
    assert solution.log_determinant == pytest.approx(expected)


@pytest.mark.parametrize("loss", [HUBER, CAUCHY])
def test_weights_are_those_of_the_loss(loss):
    residuals, nudge = np.linspace(-20, 20, 81), 1e-6
    slope = loss.cost(residuals + nudge) - loss.cost(residuals - nudge)
    np.testing.assert_allclose(
        slope / (2 * nudge), loss.weights(residuals) * residuals, atol=1e-5
    )


def test_limits_of_errors_are_parts_of_the_ranges():
    for error, (low, high) in (
        (ERRORS_MAX[RIGHT], RANGES.wheel_radius),
        (ERRORS_MAX[OWN_TRACK], RANGES.track),
        (ERRORS_MAX[GAINS].max(), RANGES.gain),
    ):
        assert error < np.log(high / low) / 4
