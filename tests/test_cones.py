"""Sensors with three rays: what they measure, on both rungs, and what is refused."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from epuck_mj.constants import N_PROXIMITY, PROXIMITY_ANGLES, PROXIMITY_COUNTS
from epuck_mj.policies.network import Network
from epuck_mj.rungs.kinematic.cones import widen
from epuck_mj.rungs.kinematic.robots import KinematicRobots
from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.changed_robots import with_sensors_set_back
from epuck_mj.scene.geometry import kinematics
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import MODELS
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.show.rays import ray_lines
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.cones import cone_distance
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.sensors import PROXIMITY_REACH
from epuck_mj.trials.recorder import record_trajectories
from tests.refusals import refused
from tests.test_kinematic import both_ways

WHEELS, KINEMATIC = "epuck_cone", "epuck_cone_kinematic"
BOTH = (WHEELS, KINEMATIC)
COSINES = np.full(N_PROXIMITY, np.cos(np.radians(15)))
FLOOR = '<geom name="floor" type="plane" size="2 2 .1" contype="2" conaffinity="2"/>'


def arena(tmp_path, geoms: str) -> str:
    path = tmp_path / "some.xml"
    path.write_text(f"<mujoco><worldbody>{FLOOR}{geoms}</worldbody></mujoco>")
    return str(path)


def lengths(n: int) -> np.ndarray:
    """Lengths of three rays of sensors, `(3, n, 8)`: near, far, and none at all."""
    rng = np.random.default_rng(0)
    found = rng.uniform(0, 0.05, (3, n, N_PROXIMITY))
    found[:, ::2] *= rng.uniform(0, 4, found[:, ::2].shape)
    found[rng.random(found.shape) < 0.1] = -1
    found[rng.random(found.shape) < 0.02] = rng.choice([0, 0.005, PROXIMITY_REACH, 1e5])
    return found


def test_three_rays_count_as_published():
    """Against the formula, one sensor at a time, with the functions of libm."""
    metres, counts = map(list, zip(*PROXIMITY_COUNTS.items(), strict=True))
    logs = np.log(counts)

    def r(distance: float) -> float:
        seen = 0 <= distance <= metres[-1]
        return float(np.exp(np.interp(distance, metres, logs))) if seen else 0.0

    middle, left, right = lengths(300)
    found = cone_distance(middle, left, right, COSINES)
    for index in np.ndindex(middle.shape):
        d = middle[index]
        total = r(left[index]) + (r(d) - 2 * r(d / COSINES[0])) + r(right[index])
        expected = -1.0
        if total > 0:
            expected = np.interp(np.log(total), logs[::-1], metres[::-1])
        assert found[index] == pytest.approx(expected, abs=1e-12)
    assert 0.05 < (found < 0).mean() < 0.95


def test_compiled_cones_have_the_same_bits():
    middle, left, right = lengths(2000)
    expected = cone_distance(middle, left, right, COSINES)
    for i in range(len(middle)):
        found = middle[i].copy()
        widen(COSINES, np.concatenate([left[i], right[i]]), found)
        np.testing.assert_array_equal(found, expected[i])


@pytest.mark.parametrize("suffix", ["", "_kinematic"])
def test_a_flat_wall_faced_squarely_is_as_far_as_for_one_ray(tmp_path, suffix):
    wall = '<geom name="wall" type="box" size=".01 1 .03" pos=".51 0 .03"/>'
    path = arena(tmp_path, wall)
    one, cone = (load_scene(f"{name}{suffix}", path) for name in ("epuck", WHEELS))
    gaps = np.linspace(0.0005, 0.1195, 60)
    for sensor, degrees in enumerate(PROXIMITY_ANGLES):
        poses = np.zeros((len(gaps), 3))
        poses[:, 0], poses[:, 2] = 0.465 - gaps, -np.radians(degrees)
        single, wide = (
            robots_in(scene, len(gaps), 1).reset(poses).distance[:, sensor]
            for scene in (one, cone)
        )
        np.testing.assert_allclose(wide, single, rtol=0, atol=1e-9)
        np.testing.assert_allclose(single, gaps, atol=1e-6)


@pytest.mark.parametrize("set_back", [0.0, 0.002])
@pytest.mark.parametrize("name", ["arena", "pillars", "round"])
def test_both_rungs_measure_what_mj_ray_does(name, set_back):
    """A ray at a time; the sensors of some robots are elsewhere."""
    scenes = [load_scene(each, name) for each in BOTH]
    if set_back:
        scenes = [with_sensors_set_back(each, set_back) for each in scenes]
    n, (scene, kinematic) = 200, scenes
    poses = FreeSpace(scene, 0.001).sample(np.random.default_rng(5), n)
    model, data = scene.model, mujoco.MjData(scene.model)
    _, _, origin, direction = kinematics(scene, poses)
    length = np.empty((n, len(scene.rays)))
    hit = np.zeros(1, np.int32)
    body = model.site_bodyid[scene.rays[0]]
    for i, qpos in enumerate(scene.qpos(poses)):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        for k in range(len(scene.rays)):
            length[i, k] = mujoco.mj_ray(
                model, data, origin[i, k], direction[i, k], None, 1, body, hit
            )
    middle, left, right = np.split(length, 3, axis=1)
    expected = cone_distance(middle, left, right, scene.cosines)
    on_wheels = MujocoRobots(scene, n, 1).reset(poses).distance
    rolling = KinematicRobots(kinematic, n).reset(poses).distance
    np.testing.assert_allclose(on_wheels, expected, atol=1e-9)
    np.testing.assert_allclose(rolling, expected, atol=1e-9)
    assert (expected >= 0).mean() > 0.05


def test_all_rays_of_a_sensor_move_with_it():
    """A body that is wider, or has its sensors set back, on both rungs alike."""
    rng, n = np.random.default_rng(3), 500
    poses = rng.uniform([-0.464, -0.464, -np.pi], [0.464, 0.464, np.pi], (n, 3))
    shapes = rng.uniform([[-0.001], [0.0]], [[0.0065], [0.003]], (2, n))
    bodies = replace(Bodies.own(n), wider=shapes[0], set_back=shapes[1])
    readings = []
    for name in BOTH:
        robots = robots_in(load_scene(name, "arena"), n, 1)
        before = robots.reset(poses).distance
        robots.embody(bodies)
        readings.append(robots.reset(poses).distance)
        assert (readings[-1] != before).any()
    np.testing.assert_allclose(*readings, atol=1e-9)


@pytest.mark.parametrize("noise", ["none", "strong"])
@pytest.mark.parametrize("name", ["arena", "pillars", "round"])
def test_compiled_trials_have_the_bits_of_the_loop(name, noise):
    for step, reach in ((0.1, 0.04), (0.07, 0.2)):
        scene = load_scene(KINEMATIC, name, step)
        task = TaskParameters(60, step, "product", reach)
        conditions = Conditions(noise, randomise_all=noise != "none")
        met = conditions.draw(np.random.default_rng(2), 40, task.steps)
        both_ways(scene, task, Network(), met, 40, threads=2)
        if met is None:
            scene = with_sensors_set_back(scene, 0.002)
            both_ways(scene, task, Network(), None, 40)


def seen_ahead(tmp_path, robot: str, width: int) -> bool:
    """Whether a robot sees a round post, `width` mm wide, 1 to 25 mm dead ahead."""
    radius = width / 2000
    post = f'<geom type="cylinder" size="{radius} .03" pos="{radius} 0 .03"/>'
    wall = '<geom type="box" size="1 .01 .03" pos="0 1 .03"/>'
    scene = load_scene(robot, arena(tmp_path, post + wall))
    poses = np.zeros((25, 3))
    poses[:, 0] = -0.035 - np.arange(1, 26) / 1000
    distance = robots_in(scene, 25, 1).reset(poses).distance
    seen = ((distance >= 0) & (distance < 0.04)).any(axis=1)
    assert seen.all() or not seen.any()
    return bool(seen.all())


@pytest.mark.parametrize(
    ("one", "cone"), [("epuck", WHEELS), ("epuck_kinematic", KINEMATIC)]
)
def test_cones_see_posts_dead_ahead_that_single_rays_do_not(tmp_path, one, cone):
    for width in (24, 26, 28):
        assert not seen_ahead(tmp_path, one, width)
        assert seen_ahead(tmp_path, cone, width)
    # the innermost rays begin 21 mm apart and do not meet
    assert not seen_ahead(tmp_path, cone, 20)


def test_the_shipped_robot_is_the_other_one_with_more_rays():
    def canonical(name: str) -> str:
        root = ElementTree.parse(MODELS / name).getroot()
        assert root.attrib.pop("model") == name.removesuffix(".xml")
        for parent in list(root.iter()):
            for child in list(parent):
                if re.fullmatch(r"ps\d_(left|right)", child.get("name", "")):
                    assert child.tag in ("site", "rangefinder")
                    parent.remove(child)
        text = ElementTree.tostring(root, encoding="unicode")
        return ElementTree.canonicalize(text, strip_text=True)

    assert canonical("epuck_cone.xml") == canonical("epuck.xml")
    scene = load_scene(WHEELS, "arena")
    assert scene.rays.shape == (3 * N_PROXIMITY,)
    np.testing.assert_allclose(scene.cosines, COSINES, rtol=1e-9)
    _, _, origin, direction = kinematics(scene, np.zeros((1, 3)))
    headings = np.degrees(np.arctan2(direction[0, :, 1], direction[0, :, 0]))
    sides = np.repeat([0, 15, -15], N_PROXIMITY)
    off = headings - np.tile(PROXIMITY_ANGLES, 3) - sides
    np.testing.assert_allclose((off + 180) % 360 - 180, 0, atol=1e-5)
    np.testing.assert_array_equal(origin[0], np.tile(origin[0, :N_PROXIMITY], (3, 1)))


def refusal(tmp_path, old: str, new: str) -> str:
    """Why a cone robot with one thing changed is refused."""
    text = (MODELS / "epuck_cone.xml").read_text()
    assert len(re.findall(old, text)) == 1
    path = tmp_path / "mine.xml"
    path.write_text(re.sub(old, new, text))
    message = refused(load_scene, str(path), "arena")
    assert str(path) in message
    return message


EQUAL = (
    "expected rays 'ps2_left' and 'ps2_right' to begin where 'ps2' does, in one plane "
    "with it, at equal angles below 90 degrees to its left and right; got "
)


def test_rays_that_are_no_cone_are_refused(tmp_path):
    message = refusal(tmp_path, '.*<rangefinder name="ps3_right".*', "")
    assert message.endswith(
        "has a rangefinder 'ps0_left': expected psK_left and psK_right for every K "
        "from 0 to 7, got no 'ps3_right'"
    )
    other = '<gyro name="ps3_right" site="imu"/>'
    message = refusal(tmp_path, '<rangefinder name="ps3_right".*', other)
    assert "expected sensor 'ps3_right' to be a rangefinder" in message
    for old, new, got in (
        (
            "",
            'pos="0 -0.035 0.033" zaxis="0.5 -0.8660254 0"',
            "30.0 degrees to the left and 15.0 to the right",
        ),
        (
            "",
            'pos="0 -0.035 0.033" zaxis="-0.5 -0.8660254 0"',
            "-30.0 degrees to the left and 15.0 to the right",
        ),
        (
            "",
            'pos="0 -0.035 0.033" zaxis="0 -1 0"',
            "0.0 degrees to the left and 15.0 to the right",
        ),
        (
            "",
            'pos="0.001 -0.035 0.033" zaxis="0.2588190 -0.9659258 0"',
            "a ray that begins 1.0 mm beside it",
        ),
        (
            "",
            'pos="0 -0.035 0.033" zaxis="0.25 -0.9659258 0.06699"',
            "a ray 3.8 degrees out of the plane of the others",
        ),
    ):
        old = '(name="ps2_left" class="epuck/proximity" )pos=[^/]*'
        assert refusal(tmp_path, old, rf"\g<1>{new}").endswith(EQUAL + got)


def test_cones_of_ones_own_may_have_other_angles(tmp_path):
    """Of some sensors, with the digits that people write."""
    text = (MODELS / "epuck_cone.xml").read_text()
    for side, x in (("left", 0.3420), ("right", -0.3420)):
        old = rf'(name="ps2_{side}" class="epuck/proximity" )pos=[^/]*'
        text = re.sub(old, rf'\g<1>pos="0 -0.035 0.033" zaxis="{x} -0.9397 0"', text)
    path = tmp_path / "mine.xml"
    path.write_text(text)
    cosines = load_scene(str(path), "arena").cosines
    np.testing.assert_allclose(
        np.degrees(np.arccos(cosines))[[2, 3]], [20, 15], atol=0.01
    )


@pytest.mark.parametrize("robot", BOTH)
def test_pictures_have_all_rays_as_long_as_what_is_measured(robot):
    scene, task = load_scene(robot, "arena"), TaskParameters(steps=5)
    start = np.array([[0.44, 0.0, 0.2]])
    network = Network()
    policy = network.decode(np.zeros((1, network.n_genes)))
    (trial,) = record_trajectories(scene, policy, start, task)
    lines, colors = ray_lines(scene, trial, 0.04)
    assert lines.shape == (6, 24, 2, 3)
    assert colors.shape == (6, 24, 3)
    length = np.linalg.norm(lines[:, :, 1] - lines[:, :, 0], axis=-1)
    expected = np.where(trial.distance < 0, 0.04, np.minimum(trial.distance, 0.04))
    np.testing.assert_allclose(length, np.tile(expected, 3), atol=1e-12)
    assert (expected < 0.03).any()
