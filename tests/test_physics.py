"""What the compiled robots do: kinematics, sensors, contacts, warnings."""

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from epuck_mj import constants as c
from epuck_mj.rungs.table import RUNGS, robots_in
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import ON_WHEELS, is_kinematic
from epuck_mj.scene.robot_parts import PREFIX, SHELL, WHEELS
from epuck_mj.step.cones import cone_distance

OPEN = """<mujoco>
  <option timestep="0.01" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1" contype="2" conaffinity="2"/>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module", params=ON_WHEELS.values())
def alone(request, tmp_path_factory):
    """A robot on wheels on a floor without walls."""
    path = tmp_path_factory.mktemp("arena") / "open.xml"
    path.write_text(OPEN)
    return load_scene(request.param, str(path))


def drive(scene, left: float, right: float, seconds: float) -> np.ndarray:
    """Pose after driving from rest, `(3,)`, with the yaw counted beyond a turn."""
    model, data = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_forward(model, data)
    data.ctrl[scene.wheels] = left, right
    yaw, last = 0.0, 0.0
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        now = scene.poses(data.qpos)[2]
        yaw += (now - last + np.pi) % (2 * np.pi) - np.pi
        last = now
    return np.array([*scene.poses(data.qpos)[:2], yaw])


def test_one_metre_straight(alone):
    seconds = 1.0 / c.SPEED_MAX
    x, y, yaw = drive(alone, c.WHEEL_SPEED_MAX, c.WHEEL_SPEED_MAX, seconds)
    steps = round(seconds / alone.model.opt.timestep) * alone.model.opt.timestep
    assert x == pytest.approx(steps * c.SPEED_MAX, rel=0.005)
    assert abs(y) < 0.001
    assert abs(yaw) < 0.001


def test_ten_turns_on_the_spot(alone):
    speed = c.WHEEL_SPEED_MAX / 2
    rate = 2 * speed * c.WHEEL_RADIUS / c.TRACK
    x, y, yaw = drive(alone, -speed, speed, 20 * np.pi / rate)
    assert yaw == pytest.approx(20 * np.pi, rel=0.01)
    assert np.hypot(x, y) < 0.001


def test_an_arc(alone):
    left, right, seconds = 3.0, 6.0, 4.0
    speed = (left + right) / 2 * c.WHEEL_RADIUS
    rate = (right - left) * c.WHEEL_RADIUS / c.TRACK
    radius, angle = speed / rate, rate * seconds
    x, y, yaw = drive(alone, left, right, seconds)
    expected = radius * np.array([np.sin(angle), 1 - np.cos(angle)])
    np.testing.assert_allclose([x, y], expected, atol=0.01 * speed * seconds)
    assert yaw == pytest.approx(angle, rel=0.01)


def test_no_sensor_sees_the_robot_itself(alone):
    """With nothing around, whatever the robot does, every ray misses."""
    model, data = alone.model, mujoco.MjData(alone.model)
    rng = np.random.default_rng(0)
    for _ in range(200):
        data.ctrl[alone.wheels] = rng.uniform(-1, 1, 2) * c.WHEEL_SPEED_MAX
        mujoco.mj_step(model, data, alone.n_substeps)
        mujoco.mj_step1(model, data)
        reading = alone.reading(data.sensordata)
        np.testing.assert_array_equal(reading.distance, -1)
        assert not reading.contact


def test_distances_are_those_from_the_shell(scene):
    """Facing the east wall from 2 cm, as geometry says."""
    clearance = 0.02
    x = 0.5 - c.BODY_RADIUS - clearance
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos(np.array([x, 0, 0]))
    mujoco.mj_forward(model, data)
    distance = scene.reading(data.sensordata).distance
    front, angles = [0, 1, 6, 7], np.deg2rad(c.PROXIMITY_ANGLES)
    begin = c.BODY_RADIUS * np.cos(angles)
    # a cone's outer rays begin where the middle one does
    sides = np.deg2rad([0, 15, -15])[: len(scene.rays) // 8, None]
    expected = (0.5 - x - begin) / np.cos(angles + sides)
    if scene.cosines.size:
        middle, left, right = expected
        expected = cone_distance(middle, left, right, scene.cosines)[None]
    np.testing.assert_allclose(distance[front], expected[0, front], atol=1e-5)
    # turned to the left, the wall is on the right
    data.qpos[:] = scene.qpos(np.array([x, 0, np.pi / 2]))
    mujoco.mj_forward(model, data)
    distance = scene.reading(data.sensordata).distance
    assert distance[2] == pytest.approx(clearance, abs=1e-5)
    assert distance[5] > 0.5 or (scene.cosines.size and distance[5] < 0)


@pytest.mark.parametrize(("gap", "touches"), [(1e-4, False), (-1e-4, True)])
def test_shell_reports_its_contact_with_walls(scene, gap, touches):
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos(np.array([0.5 - c.BODY_RADIUS - gap, 0.1, 1.0]))
    mujoco.mj_forward(model, data)
    assert scene.reading(data.sensordata).contact == touches


def test_shell_meets_walls_and_wheels_the_floor():
    scene = load_scene("epuck", "arena")
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos(np.array([0.4655, 0.0, 0.0]))
    seen = set()
    for _ in range(300):
        data.ctrl[:] = c.WHEEL_SPEED_MAX
        mujoco.mj_step(model, data)
        names = ([model.geom(g).name for g in contact.geom] for contact in data.contact)
        seen |= {tuple(sorted(pair)) for pair in names}
    assert (SHELL, "wall_east") in seen
    assert {pair for pair in seen if SHELL in pair} == {(SHELL, "wall_east")}
    rest = {name for pair in seen if SHELL not in pair for name in pair}
    supports = {f"{PREFIX}support_front", f"{PREFIX}support_rear"}
    assert {*WHEELS} <= rest <= {*WHEELS, "floor", *supports}


def test_gyro_and_velocimeter(alone):
    model, data = alone.model, mujoco.MjData(alone.model)
    data.ctrl[alone.wheels] = 2.0, 4.0
    mujoco.mj_step(model, data, 100)
    mujoco.mj_step1(model, data)
    rate, speed = 2 * c.WHEEL_RADIUS / c.TRACK, 3 * c.WHEEL_RADIUS
    np.testing.assert_allclose(data.sensor("epuck/gyro").data, [0, 0, rate], atol=0.05)
    np.testing.assert_allclose(
        data.sensor("epuck/velocimeter").data, [speed, 0, 0], atol=0.002
    )


@pytest.mark.slow
def test_random_driving_warns_of_nothing(scene):
    """Along walls, into walls and corners included; nobody leaves the arena.

    A hundred thousand physics steps.
    """
    n_robots, n_calls = 100, 1_000 // scene.n_substeps
    rng = np.random.default_rng(1)
    batch = Batch(scene.model, n_robots, 0, persistent=True)
    poses = rng.uniform([-0.45, -0.45, -np.pi], [0.45, 0.45, np.pi], (n_robots, 3))
    batch.bind("qpos")[:] = scene.qpos(poses)
    ctrl, touched = batch.bind("ctrl"), np.zeros(n_robots, int)
    sensordata = batch.bind("sensordata")
    for call in range(n_calls):
        # half keep their command for two seconds and so push along walls
        turn = np.ones(n_robots, bool)
        turn[: n_robots // 2] = call % 20 == 0
        action = rng.uniform(-0.5, 1.5, (n_robots, 2))
        command = np.clip(action, -1, 1) * c.WHEEL_SPEED_MAX
        ctrl[np.ix_(turn, scene.wheels)] = command[turn]
        batch.step(nstep=scene.n_substeps)
        touched += scene.reading(sensordata).contact
    assert batch.warning.sum() == 0
    assert touched.sum() > 0.05 * n_robots * n_calls
    inside = np.abs(scene.poses(batch.bind("qpos"))[:, :2]) < 0.5
    assert inside.all()


@pytest.mark.parametrize("robot", RUNGS)
@pytest.mark.parametrize("step", [None, 0.002])
def test_robots_fall_behind_their_commands_by_17_ms(robot, step):
    """Whatever the physics step: what is late is the way, not only the speed."""
    scene = load_scene(robot, "large_square", physics_step=step)
    robots, speed = robots_in(scene, 1, 1), 4.0
    late = []
    for left in (speed, -speed / 2):
        robots.reset(np.zeros((1, 3)))
        for _ in range(10):
            robots.step(np.array([[left, abs(left)]]))
        x, _, yaw = robots.poses()[0]
        full = (
            left * c.WHEEL_RADIUS if left > 0 else 2 * c.WHEEL_RADIUS / c.TRACK * -left
        )
        late.append(1 - (x if left > 0 else yaw) / full)
    time_constants = np.array([0.0167, 0.0164])
    # tyres slip a little
    slip = 1e-4 if is_kinematic(robot) else 0.0016
    assert (late >= time_constants - 1e-4).all()
    assert (late <= time_constants + slip).all()
