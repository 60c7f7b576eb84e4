"""A real robot as `control.Robot`, in virtual time: odometry, pace, watchdog, stops."""

import math

import numpy as np
import pytest

from epuck_mj.bridge.drive.odometry import Odometry
from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.schedule import Schedule
from epuck_mj.bridge.drive.session import Session
from epuck_mj.bridge.failures import (
    BridgeError,
    ComputerBusy,
    LinkLost,
    RobotRestarted,
    StaleReading,
    StillMoving,
)
from epuck_mj.bridge.fake.builds import BUILDS
from epuck_mj.bridge.fake.emulator import Emulator
from epuck_mj.bridge.fake.scenarios import Fault, random_scenario, scenario
from epuck_mj.bridge.fake.simulated_body import SimulatedBody
from epuck_mj.bridge.language.replies import Cycle, Proximity, Steps, wrapped
from epuck_mj.bridge.line.interfaces import Greeting
from epuck_mj.bridge.line.last_resort import stop_at_last
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_line import SerialLine
from epuck_mj.constants import (
    CONNECT_TIME_MAX,
    PURSUIT_TIME,
    SPEED_MAX,
    STOP_TIME_MAX,
    TRACK,
    WHEEL_RADIUS,
    WHEEL_SPEED_MAX,
)
from epuck_mj.errors import UserError
from epuck_mj.policies.network import Network
from epuck_mj.policies.topology import NETWORKS
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.model import load_scene
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.fitness import FORMULAS
from epuck_mj.step.motors import STEP_ANGLE, actual_rates
from epuck_mj.step.sensors import sensed_distance
from tests.bridge_reference import at_control_steps, deviation, nominal, same_times
from tests.virtual_time import VirtualPort, VirtualTime

TASK = TaskParameters()
CENTRE = np.zeros(3)
AT_WALL = np.array([0.44, 0.0, math.pi / 2])
FULL = np.full(2, WHEEL_SPEED_MAX)


class World:
    """An emulated robot and a real one on top of it, on one clock."""

    def __init__(
        self,
        scene,
        start=CENTRE,
        robot="asercom",
        faults: str | tuple[Fault, ...] = "",
        latency=0.0,
        **options,
    ):
        self.time = VirtualTime()
        self.body = SimulatedBody(scene, np.asarray(start, float), 0.0)
        faults = scenario(faults) if isinstance(faults, str) else faults
        self.emulator = Emulator(
            self.body, robot, 0.0, faults, latency, options.pop("seed", 0)
        )
        self.time.carry(self.emulator)
        # its banner, and what it does by itself as it starts
        self.time.sleep(3.0)
        self.began = self.time.now
        self.link = self.linked()
        self.robot = RealRobot(
            SerialLine(self.link),
            options.pop("calibration", Calibration()),
            TASK.control_step,
            clock=self.time.clock,
            sleep=self.time.sleep,
            start=start,
            **options,
        )
        self.session = Session(TASK)

    def linked(self) -> Link:
        return Link(lambda: VirtualPort(self.time), self.time.clock, self.time.sleep)

    def stopped_at_last(self) -> bool:
        """Whether the robot confirms that it stopped, after its bridge has ended."""
        return stop_at_last(
            lambda: SerialLine(self.linked()),
            clock=self.time.clock,
            sleep=self.time.sleep,
        )

    def drive(self, n_steps, policy=None):
        """Greet, drive, stop."""
        with self.robot:
            self.robot.greet()
            for _ in self.session.drive(
                self.robot, policy or WallFollower(), n_steps, self.time.clock
            ):
                pass

    @property
    def commands(self):
        """Rates of both wheels as the body was told, in their order."""
        return [(row[0], row[2]) for row in self.body.journal.command]


# pure parts


def test_odometry_straight_and_on_the_spot():
    odometry = Odometry(Calibration(), np.array([1.0, 2.0, math.pi / 2]))
    odometry.update(Steps(5, 5), 0.0, 0.0)
    np.testing.assert_array_equal(odometry.pose, [1.0, 2.0, math.pi / 2])
    odometry.update(Steps(1005, 1005), 1.0, 1.0)
    np.testing.assert_allclose(
        odometry.pose, [1.0, 2.0 + 2 * math.pi * WHEEL_RADIUS, math.pi / 2]
    )
    assert odometry.length == pytest.approx(2 * math.pi * WHEEL_RADIUS)
    # 90 degrees on the spot are 323 steps: section 1 of the datasheet
    quarter = math.pi / 4 * TRACK / (WHEEL_RADIUS * STEP_ANGLE)
    assert quarter == pytest.approx(323, abs=0.5)
    odometry.update(Steps(1005 - 323, 1005 + 323), 2.0, 2.0)
    assert odometry.pose[2] == pytest.approx(math.pi, abs=0.003)
    assert odometry.length == pytest.approx(2 * math.pi * WHEEL_RADIUS)


def test_odometry_of_a_circle_is_one():
    """Arcs are exact, in however few pieces."""
    calibration = Calibration(wheel_radii=(0.0201, 0.0205), track=0.0551)
    odometry = Odometry(calibration, np.zeros(3))
    made, now = np.zeros(2), 0.0
    per_turn = 2 * math.pi * 0.0551 / ((2 * 0.0205 - 0.0201) * STEP_ANGLE)
    odometry.update(Steps(0, 0), 0.0, 0.0)
    for _ in range(16):
        made += np.array([1.0, 2.0]) * per_turn / 16
        now += 1.0
        left, right = (wrapped(round(steps)) for steps in made)
        odometry.update(Steps(left, right), now, now)
    assert odometry.pose[2] == pytest.approx(2 * math.pi, abs=2e-3)
    np.testing.assert_allclose(odometry.pose[:2], 0, atol=2e-4)


@pytest.mark.parametrize("sign", [1, -1])
def test_counters_wrap(sign):
    odometry = Odometry(Calibration(), np.zeros(3))
    made = 0
    for now in range(100):
        steps = wrapped(sign * made)
        odometry.update(Steps(steps, steps), now, now)
        made += 950
    expected = sign * 99 * 950 * STEP_ANGLE * WHEEL_RADIUS
    assert odometry.pose[0] == pytest.approx(expected)


def test_more_steps_than_a_motor_makes_are_a_reset():
    odometry = Odometry(Calibration(), np.zeros(3))
    odometry.update(Steps(20_000, 20_000), 0.0, 0.0)
    with pytest.raises(BridgeError, match="the robot was reset"):
        odometry.update(Steps(0, 0), 0.1, 0.1)


def test_schedule():
    now = [10.0]
    slept = []

    def sleep(duration):
        slept.append(duration)
        now[0] += duration

    schedule = Schedule(0.1, lambda: now[0], sleep)
    schedule.begin()
    for work in (0.03, 0.0, 0.099):
        now[0] += work
        schedule.wait()
    # late awakenings do not add up
    assert now[0] == pytest.approx(10.3)
    assert schedule.n_overruns == 0
    now[0] += 0.25
    schedule.wait()
    assert schedule.n_overruns == 1
    assert now[0] == pytest.approx(10.55)
    schedule.wait()
    assert now[0] == pytest.approx(10.65)
    assert len(slept) == 4


# the robot


def test_who_is_there(kinematic):
    world = World(kinematic)
    with world.robot as robot:
        assert robot.greet() == Greeting(
            "Version 1.2.2 August 2008 GCtronic, HW version: 1.1", "good"
        )


@pytest.mark.parametrize("build", ["btcom", "epuck2"])
def test_robots_that_do_not_tell_their_battery(kinematic, build):
    world = World(kinematic, robot=build)
    with world.robot as robot:
        assert robot.greet().battery == "unknown to this firmware"
    assert world.body.standing


def test_a_low_battery(kinematic):
    world = World(kinematic)
    world.body.volts = 3.3
    with world.robot as robot:
        assert robot.greet().battery == "low"


def test_a_robot_left_driving_is_stopped_first(kinematic):
    world = World(kinematic)
    world.time.send(b"D,500,500\r")
    world.time.sleep(0.5)
    assert not world.body.standing
    with world.robot as robot:
        robot.greet()
        assert world.body.standing


@pytest.mark.parametrize(
    "heard", [b"D,5", b"\xbc\x2c", b"\xbc\x2c\x01\x2c\x01\xb2", b"nonsense", b"\r"]
)
def test_half_a_word_of_whoever_was_there_before(kinematic, heard):
    world = World(kinematic)
    world.time.send(b"D,500,500\r")
    world.time.send(heard)
    world.time.sleep(0.5)
    with world.robot as robot:
        robot.greet()
        assert world.body.standing


def test_readings_are_the_sensors(kinematic):
    world = World(kinematic, AT_WALL)
    with world.robot as robot:
        robot.greet()
        reading = robot.begin()
        counts = world.body.journal.sample[-1]
        np.testing.assert_array_equal(robot.last.proximity, counts)
        np.testing.assert_array_equal(reading.distance, sensed_distance(counts))
        assert counts.max() > 100
        assert not reading.contact


def test_gains_of_the_calibration(kinematic):
    gains = tuple(np.linspace(0.6, 1.5, 8))
    world = World(kinematic, AT_WALL, calibration=Calibration(gains))
    with world.robot as robot:
        robot.greet()
        distance = robot.begin().distance
    counts = world.body.journal.sample[-1]
    np.testing.assert_array_equal(distance, sensed_distance(counts, np.array(gains)))


def test_calibration_of_the_sensors(kinematic):
    world = World(kinematic, AT_WALL)
    with world.robot as robot:
        robot.greet()
        robot.calibrate()
        robot.begin()
        np.testing.assert_array_equal(robot.last.proximity, 0)


def test_speeds_are_sent_when_they_change_only(kinematic):
    world = World(kinematic)
    with world.robot as robot:
        robot.greet()
        robot.begin()
        before = len(world.commands)
        for speed in (3.0, 3.0, 3.0, 2.0, 2.0, 2.001):
            robot.step(np.full(2, speed))
        told = [round(rate) for rate, _ in world.commands[before:]]
    # 2.001 rad/s are the same whole steps/s as 2
    real = actual_rates(np.array([477, 318])).round().astype(int)
    assert told == [*real]
    assert world.commands[-1] == (0.0, 0.0)


def test_both_wheels_are_slowed_alike(kinematic):
    world = World(kinematic, speed_max=SPEED_MAX / 2)
    with world.robot as robot:
        robot.greet()
        robot.begin()
        for command, rates in (
            ((1.0, 0.5), (500, 250)),
            ((-1.0, 1.0), (-500, 500)),
            ((0.4, 0.1), (400, 100)),
            ((0.0, 0.0), (0, 0)),
        ):
            robot.step(np.array(command) * WHEEL_SPEED_MAX)
            assert tuple(robot.last.rates) == rates


def test_a_dry_run_stands_still(kinematic):
    world = World(kinematic, AT_WALL, dry_run=True)
    world.drive(20)
    assert not any(any(command) for command in world.commands)
    np.testing.assert_allclose(world.body.pose, AT_WALL, atol=1e-6)
    trajectory = world.session.trajectory(WallFollower())
    assert trajectory is not None
    assert not trajectory.command.any()
    assert trajectory.action.any()


def test_a_step_lasts_a_control_step(kinematic):
    world = World(kinematic, latency=0.01)
    world.drive(30)
    times = [step.moment.time for step in world.session.steps]
    np.testing.assert_allclose(np.diff(times), 0.1, atol=0.005)
    assert world.robot.schedule.n_overruns == 0
    assert world.session.steps[-1].moment.latency == pytest.approx(0.024, abs=0.005)


def test_a_slow_line_is_an_overrun_and_no_step_is_shorter(kinematic):
    world = World(kinematic, latency=0.06)
    world.drive(20)
    times = [step.moment.time for step in world.session.steps]
    assert world.robot.schedule.n_overruns > 0
    assert np.diff(times).min() > 0.09


@pytest.mark.parametrize("robot", RUNGS)
@pytest.mark.parametrize("build", BUILDS)
def test_the_loop_is_the_simulations(robot, build):
    """The emulated robot goes where the simulation goes, at the same times.

    For a minute with wheels and the commonest build, for 20 s with the others.
    """
    n_steps = 600 if (robot, build) == ("epuck", "asercom") else 200
    scene = load_scene(robot, "arena")
    start = np.array([0.1, -0.2, 0.7])
    world = World(scene, start, robot=build)
    world.drive(n_steps)
    journal = world.body.journal
    assert world.robot.schedule.n_overruns == 0
    assert not any(journal.contact)
    timer = BUILDS[build].timer
    simulated = same_times(scene, WallFollower(), TASK, start, journal, timer)
    moved, turned = deviation(simulated, np.array(journal.pose)[: len(simulated)])
    assert len(simulated) > n_steps * scene.n_substeps
    assert moved < 1e-3
    assert turned < math.radians(1)
    # it went somewhere, and odometry knows roughly where
    assert world.robot.odometry.length > 4 * n_steps / 600
    assert np.hypot(*(world.robot.odometry.pose - world.body.pose)[:2]) < 0.2


def test_the_loop_is_the_plain_simulations_with_long_physics_steps():
    """Where sensors are never older than one of them, times make no difference."""
    scene = load_scene("epuck_kinematic", "arena", physics_step=0.025)
    start = np.array([0.1, -0.2, 0.7])
    world = World(scene, start)
    world.drive(200)
    poses = at_control_steps(scene, world.body.journal, 200)
    plain = nominal(scene, WallFollower(), TASK, start, 200)[: len(poses)]
    moved, turned = deviation(plain, poses)
    assert len(poses) == 201
    assert moved < 1e-3
    assert turned < math.radians(1)


def test_the_same_again_is_the_same(kinematic):
    def poses():
        world = World(kinematic, AT_WALL, faults="loss@0.5+1,garbage@2", seed=3)
        try:
            world.drive(40)
        except BridgeError as error:
            return str(error), np.array(world.body.journal.pose)
        return "", np.array(world.body.journal.pose)

    (first, a), (second, b) = poses(), poses()
    assert first == second
    np.testing.assert_array_equal(a, b)


def test_trajectory_of_a_session(kinematic):
    world = World(kinematic, AT_WALL)
    policy = Network().decode(np.linspace(-1, 1, Network().n_genes))
    world.drive(25, policy)
    trajectory = world.session.trajectory(policy)
    assert trajectory is not None
    assert trajectory.steps == 25
    assert trajectory.time[0] == 0
    np.testing.assert_allclose(trajectory.time, np.arange(26) * 0.1, atol=0.02)
    np.testing.assert_array_equal(trajectory.pose[0], AT_WALL)
    np.testing.assert_array_equal(trajectory.proximity, trajectory.proximity.round())
    np.testing.assert_array_equal(
        trajectory.action, policy(trajectory.observation)[:-1]
    )
    np.testing.assert_array_equal(
        trajectory.hidden, policy.activation(trajectory.observation[:-1])
    )
    rates = trajectory.command / STEP_ANGLE
    np.testing.assert_allclose(rates, rates.round(), atol=1e-9)
    expected = FORMULAS[TASK.fitness](trajectory.action, trajectory.observation[1:])
    np.testing.assert_array_equal(trajectory.fitness, expected)


@pytest.mark.parametrize("name", ["feedforward_changes", "follower"])
def test_a_robot_remembers_from_the_start_of_its_drive_on(kinematic, name):
    topology = NETWORKS[name](4, False)
    genome = np.random.default_rng(1).uniform(-5, 5, topology.n_genes)
    policy = topology.decode(genome)
    # what it saw elsewhere is forgotten
    policy(np.zeros(8))
    world = World(kinematic, AT_WALL)
    world.drive(25, policy)
    trajectory = world.session.trajectory(policy)
    assert trajectory is not None
    fresh = topology.decode(genome)
    actions = [fresh(seen) for seen in trajectory.observation[:-1]]
    np.testing.assert_array_equal(trajectory.action, actions)
    assert trajectory.hidden.shape == (25, 0 if name == "follower" else 4)


def test_a_session_that_read_nothing():
    assert Session(TASK).trajectory(WallFollower()) is None


# faults, one by one


@pytest.fixture
def at_wall(kinematic):
    worlds = []

    def make(faults, **options):
        worlds.append(World(kinematic, AT_WALL, faults=faults, **options))
        return worlds[-1]

    yield make
    for world in worlds:
        assert world.body.standing
        assert world.link.lost


def test_a_stall_is_a_stale_reading(at_wall):
    world = at_wall("stall@1")
    with pytest.raises(StaleReading, match=r"every 300 ms; got none: .* D N"):
        world.drive(100)
    # 300 ms after the last reading it was told to stop; it heard so after the stall
    assert world.time.now - world.began < 1.5 + 0.4


def test_a_short_stall_is_none(at_wall):
    world = at_wall("stall@1.03+0.05")
    world.drive(30)
    assert len(world.session.steps) == 30


def test_a_reset_ends_the_drive(at_wall):
    with pytest.raises(RobotRestarted, match="WELCOME"):
        at_wall("reset@1.02").drive(100)


def test_a_reset_nobody_heard_of_ends_the_drive(at_wall):
    # the banner is lost with the port, which returns before anybody asks
    world = at_wall("")
    with pytest.raises(BridgeError, match=r"reset|banner"), world.robot as robot:
        robot.greet()
        robot.begin()
        for _ in range(20):
            robot.step(FULL)
        world.emulator._firmware = world.emulator._switched_on(world.time.now)
        world.emulator._firmware.output(world.time.now)
        for _ in range(20):
            robot.step(FULL)


@pytest.mark.parametrize("duration", [0.05, 0.5, 2.0, 4.0])
def test_a_lost_link_is_stopped_as_soon_as_it_returns(at_wall, duration):
    """By the bridge, or by the process that it leaves behind."""
    world = at_wall(f"disconnect@1.02+{duration}")
    short = duration < STOP_TIME_MAX
    with pytest.raises(LinkLost if short else StillMoving):
        world.drive(100)
    if not short:
        assert world.time.now - world.began < 1.02 + STOP_TIME_MAX + 0.3
        assert not world.body.standing
        assert world.stopped_at_last()
    returned = world.began + 1.02 + duration
    assert world.time.now - returned < 0.5


def test_a_link_lost_for_ever_is_said_so(kinematic):
    world = World(kinematic, AT_WALL, faults="gone@1")
    with pytest.raises(StillMoving, match="expected the robot to say that it stopped"):
        world.drive(100)
    assert world.time.now - world.began < 1 + STOP_TIME_MAX + 0.5
    assert not world.stopped_at_last()
    assert not world.body.standing
    assert world.time.now - world.began < 1 + STOP_TIME_MAX + PURSUIT_TIME + 1


def test_a_lost_byte_costs_a_resynchronisation(at_wall):
    world = at_wall("")
    with world.robot as robot:
        robot.greet()
        robot.begin()
        for k in range(20):
            if k == 10:
                receive = world.time.receive
                lost = []

                def lossy(duration, receive=receive, lost=lost):
                    data = receive(duration)
                    if data and not lost:
                        lost.append(data[:1])
                        return data[1:]
                    return data

                world.time.receive = lossy
            robot.step(FULL / 2)
        assert robot.n_repairs == 1
        assert robot.schedule.n_overruns <= 1


def test_a_computer_that_slept_drives_no_further(at_wall):
    world = at_wall("")
    with (
        pytest.raises(ComputerBusy, match="got none for 1100 ms"),
        world.robot as robot,
    ):
        robot.greet()
        robot.begin()
        robot.step(FULL)
        world.time.sleep(1.1)
        robot.step(FULL)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_any_exception_stops_the_robot(at_wall, error):
    world = at_wall("")
    with pytest.raises(error), world.robot as robot:
        robot.greet()
        robot.begin()
        robot.step(FULL)
        assert not world.body.standing
        raise error


def test_nobody_waits_for_a_robot_that_calibrates(at_wall):
    """It stood when it began, and answers nothing before it has finished."""
    world, began = at_wall(""), 0.0
    with pytest.raises(KeyboardInterrupt), world.robot as robot:
        robot.greet()
        world.link.flush()
        world.time.send(b"K\r")
        world.time.sleep(0.1)
        began = world.time.now
        raise KeyboardInterrupt
    assert world.time.now - began == pytest.approx(STOP_TIME_MAX, abs=0.1)


class Deaf:
    """A connection on which nothing works but greeting."""

    n_repairs = 0

    def __init__(self, met=True):
        self.met = met
        self.stops = 0
        self.closed = False

    def greet(self):
        if not self.met:
            raise BridgeError("an e-puck", "nothing")
        return Greeting("", "")

    def cycle(self, left, right, changed, until):
        return Cycle(Proximity((0,) * 8), Steps(0, 0))

    def calibrate(self):
        pass

    def stop(self):
        self.stops += 1
        raise StillMoving("a word", "none")

    def close(self):
        self.closed = True


def test_a_robot_that_never_answered_is_not_told_to_stop():
    deaf = Deaf(met=False)
    with (
        pytest.raises(BridgeError, match="an e-puck"),
        RealRobot(deaf, Calibration(), 0.1) as robot,
    ):
        robot.greet()
    assert deaf.stops == 0
    assert deaf.closed


def test_the_first_cause_is_not_lost():
    deaf = Deaf()
    with (
        pytest.raises(StillMoving) as caught,
        RealRobot(deaf, Calibration(), 0.1) as robot,
    ):
        robot.greet()
        robot.begin()
        robot.step(FULL)
        raise LinkLost("a robot", "nobody")
    assert isinstance(caught.value.__context__, LinkLost)
    assert deaf.closed


# faults at random

N_SCENARIOS = 45
"""Five for each build and latency."""

END = 4.0


def offsets(world, build):
    """What a robot that calibrates itself as it starts takes off its counts."""
    if build != "btcom":
        return np.zeros(8, int)
    return world.body.journal.sample[0]


@pytest.mark.parametrize("build", ["asercom", "btcom", "epuck2"])
def test_the_next_drive_begins_in_step(kinematic, build):
    """A robot goes on reporting the speeds of the drive before, after S, too."""
    world = World(kinematic, robot=build)
    world.drive(5)
    assert any(world.commands[-2])
    again = RealRobot(
        SerialLine(world.linked()),
        Calibration(),
        TASK.control_step,
        clock=world.time.clock,
        sleep=world.time.sleep,
    )
    with again:
        again.greet()
        for _ in Session(TASK).drive(again, WallFollower(), 5, world.time.clock):
            pass
    assert again.n_repairs == 0
    assert world.body.standing


@pytest.mark.parametrize("seed", range(N_SCENARIOS))
def test_random_faults(kinematic, seed):
    """No hang, no wrong reading, the cause is named, and the robot stands."""
    build = ("asercom", "btcom", "epuck2")[seed % 3]
    faults = random_scenario(seed, END)
    latency = (0.0, 0.005, 0.015)[seed // 3 % 3]
    world = World(kinematic, AT_WALL, build, faults, latency, seed=seed)
    error = None
    try:
        world.drive(60)
    except BridgeError as caught:
        error = caught
    now = world.time.now
    # bounded: greeting, drive, stop
    assert now - world.began < CONNECT_TIME_MAX + 6 + STOP_TIME_MAX + 1
    kinds = {fault.kind for fault in faults}
    if isinstance(error, StillMoving) and not world.stopped_at_last():
        now = world.time.now
        # the only way not to stop it is not to reach it
        assert "gone" in kinds
        assert not world.emulator.connected(now)
    else:
        assert world.body.standing
        if isinstance(error, LinkLost):
            assert kinds & {"gone", "disconnect"}
        if isinstance(error, RobotRestarted):
            assert "reset" in kinds or "noise" in kinds
    if error is not None:
        assert "expected" in str(error)
        assert "\n" not in str(error)
    else:
        assert len(world.session.steps) == 60
    # from the moment on when it could be reached again: at most half a second
    gaps = [f for f in faults if f.kind in ("disconnect", "stall")]
    if isinstance(error, LinkLost) and not kinds & {"gone"} and world.session.steps:
        returned = world.began + max(f.start + f.duration for f in gaps)
        assert now < max(returned, world.began) + 0.5
    # every reading used is one that the sensors gave, the newer the later
    samples = [tuple(row) for row in world.body.journal.sample]
    offset = offsets(world, build)
    given = {tuple(np.maximum(np.array(row) - offset, 0)) for row in samples}
    for step in world.session.steps:
        assert tuple(step.moment.proximity.astype(int)) in given


def test_scenarios_are_read_and_refused():
    faults = scenario("stall@2,loss@1+0.25,gone@3")
    assert [str(fault) for fault in faults] == [
        "stall@2+0.5",
        "loss@1+0.25",
        "gone@3+inf",
    ]
    assert random_scenario(7, END) == random_scenario(7, END)
    for text in ("stall", "nonsense@1", "stall@-1", "stall@1+x", "stall@1 reset@2"):
        with pytest.raises(UserError, match="expected faults as in stall@2"):
            scenario(text)
