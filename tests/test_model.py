"""The compiled model against constants.py, and what load_scene refuses."""

import mujoco
import numpy as np
import pytest

from epuck_mj import constants as c
from epuck_mj.check.arena import check_arena
from epuck_mj.check.findings import Severity
from epuck_mj.errors import UserError
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import MODELS, ON_WHEELS, ROBOT_FILES
from epuck_mj.scene.robot_parts import PREFIX, PROXIMITY, ROBOT_BODY
from tests.refusals import refused


def whole_body(model) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass and inertia about it of the robot on its start."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = [b for b in range(model.nbody) if model.body_rootid[b] == 1]
    mass = model.body_mass[bodies]
    center = (mass[:, None] * data.xipos[bodies]).sum(axis=0) / mass.sum()
    inertia = np.zeros((3, 3))
    for b in bodies:
        rotation = data.ximat[b].reshape(3, 3)
        offset = data.xipos[b] - center
        inertia += rotation @ np.diag(model.body_inertia[b]) @ rotation.T
        inertia += model.body_mass[b] * (offset @ offset * np.eye(3))
        inertia -= model.body_mass[b] * np.outer(offset, offset)
    return mass.sum(), center, inertia


def test_mass_and_inertia(scene):
    mass, center, inertia = whole_body(scene.model)
    assert mass == pytest.approx(c.MASS)
    np.testing.assert_allclose(center, [0, 0, c.CENTER_OF_MASS_HEIGHT], atol=1e-7)
    np.testing.assert_allclose(inertia, np.diag(c.INERTIA), rtol=1e-4, atol=1e-12)


def test_shell(scene):
    shell = scene.model.geom(PREFIX + "shell")
    assert shell.type == mujoco.mjtGeom.mjGEOM_CYLINDER
    radius, half_height, _ = shell.size
    assert radius == c.BODY_RADIUS
    assert shell.pos[2] + half_height == pytest.approx(c.BODY_HEIGHT)
    assert shell.pos[2] - half_height == pytest.approx(c.GROUND_CLEARANCE)


def test_proximity_sites_in_the_firmware_s_order(scene):
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    for i, angle in enumerate(np.deg2rad(c.PROXIMITY_ANGLES)):
        forward = np.array([np.cos(angle), np.sin(angle), 0])
        site = data.site(f"{PREFIX}ps{i}")
        place = c.BODY_RADIUS * forward + [0, 0, c.PROXIMITY_HEIGHT]
        np.testing.assert_allclose(site.xpos, place, atol=1e-7)
        np.testing.assert_allclose(site.xmat.reshape(3, 3)[:, 2], forward, atol=1e-6)
        sensor = scene.model.sensor(f"{PREFIX}ps{i}")
        assert sensor.type == mujoco.mjtSensor.mjSENS_RANGEFINDER
        assert scene.model.site(sensor.objid[0]).name == f"{PREFIX}ps{i}"


def test_actuators(scene):
    for name in ("wheel_left", "wheel_right"):
        actuator = scene.model.actuator(PREFIX + name)
        np.testing.assert_allclose(
            actuator.ctrlrange,
            [-c.WHEEL_SPEED_MAX] * 1 + [c.WHEEL_SPEED_MAX],
            rtol=1e-15,
        )
        assert actuator.gainprm[0] == c.DRIVE_GAIN
        assert actuator.biasprm[2] == -c.DRIVE_GAIN


def test_wheels_and_supports():
    model = load_scene("epuck", "arena").model
    for name, side in (("wheel_left", 1), ("wheel_right", -1)):
        place = [0, side * c.TRACK / 2, c.WHEEL_RADIUS]
        np.testing.assert_allclose(model.body(PREFIX + name).pos, place)
        assert model.body(PREFIX + name).mass == c.WHEEL_MASS
        size = [c.WHEEL_RADIUS, c.WHEEL_WIDTH / 2, c.WHEEL_RADIUS]
        np.testing.assert_allclose(model.geom(PREFIX + name).size, size)
        assert model.geom(PREFIX + name).friction[0] == c.WHEEL_FRICTION
        joint = model.joint(PREFIX + name)
        np.testing.assert_array_equal(joint.axis, [0, 1, 0])
        assert model.dof_armature[joint.dofadr[0]] == c.DRIVE_INERTIA
    for name, side in (("support_front", 1), ("support_rear", -1)):
        geom = model.geom(PREFIX + name)
        assert geom.size[0] == c.SUPPORT_RADIUS
        assert geom.pos[0] == side * c.SUPPORT_OFFSET
        assert geom.condim == 1


def test_robot_compiles_alone():
    mujoco.MjModel.from_xml_path(str(MODELS / "epuck.xml"))


def test_arena_is_the_paper_s_square_and_opens_as_it_is():
    model = mujoco.MjModel.from_xml_path(str(MODELS / "arena.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert {"overview", "chase"} == {model.camera(i).name for i in range(model.ncam)}
    assert model.nlight >= 1
    # from the middle, the inner faces are half a metre away
    for direction in ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]):
        geom = np.zeros(1, np.int32)
        distance = mujoco.mj_ray(
            model, data, [0, 0, 0.055], np.array(direction, float), None, 1, 1, geom
        )
        assert distance == pytest.approx(0.5)
        assert model.geom(geom[0]).name.startswith("wall")


def test_poses_go_in_and_come_out(scene):
    rng = np.random.default_rng(0)
    poses = rng.uniform([-0.4, -0.4, -np.pi], [0.4, 0.4, np.pi], (50, 3))
    np.testing.assert_allclose(scene.poses(scene.qpos(poses)), poses, atol=1e-12)
    assert scene.qpos(poses[0]).shape == (scene.model.nq,)
    data = mujoco.MjData(scene.model)
    for pose in poses[:5]:
        data.qpos[:] = scene.qpos(pose)
        mujoco.mj_kinematics(scene.model, data)
        body = data.body(ROBOT_BODY)
        np.testing.assert_allclose(body.xpos[:2], pose[:2], atol=1e-12)
        forward = body.xmat.reshape(3, 3)[:, 0]
        np.testing.assert_allclose(forward[:2], [np.cos(pose[2]), np.sin(pose[2])])


WALLS = """<mujoco>
  <option timestep="0.01" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1" contype="2" conaffinity="2"/>
    <geom type="box" pos="0.31 0 0.03" size="0.01 0.32 0.03"/>
    <geom type="box" pos="-0.31 0 0.03" size="0.01 0.32 0.03"/>
    <geom type="box" pos="0 0.31 0.03" size="0.3 0.01 0.03"/>
    <geom type="box" pos="0 -0.31 0.03" size="0.3 0.01 0.03"/>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("robot", RUNGS)
def test_an_arena_of_walls_only_gets_the_robot(tmp_path, robot):
    path = tmp_path / "walls.xml"
    path.write_text(WALLS)
    scene = load_scene(robot, str(path))
    assert [scene.model.sensor(name).id for name in PROXIMITY]
    assert scene.name == robot


def test_an_arena_with_another_include_and_its_own_robot_file(tmp_path):
    (tmp_path / "more.xml").write_text(
        '<mujoco><worldbody><geom name="pillar" size="0.02"/></worldbody></mujoco>'
    )
    robot = (MODELS / "epuck.xml").read_text()
    (tmp_path / "mine.xml").write_text(robot)
    includes = '<include file="more.xml"/><include file="mine.xml"/></mujoco>'
    path = tmp_path / "arena.xml"
    path.write_text(WALLS.replace("</mujoco>", includes))
    scene = load_scene("epuck", str(path))
    assert scene.model.geom("pillar").id > 0
    # a free joint and two wheels: one robot
    assert scene.model.nq == 7 + 2


TETRAHEDRON = "v 0 0 0\nv .02 0 0\nv 0 .02 0\nv 0 0 .02\n"
TETRAHEDRON += "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def with_mesh(text: str) -> str:
    """An MJCF with a mesh for show, in a folder of meshes."""
    asset = '<asset><mesh name="hat" file="hat.obj"/></asset></mujoco>'
    geom = '<geom type="mesh" mesh="hat" contype="0" conaffinity="0" pos="0 0 .06"'
    return (
        text.replace(">", '><compiler meshdir="meshes"/>', 1)
        .replace("</mujoco>", asset)
        .replace('<geom name="shell"', f'{geom} mass="0"/><geom name="shell"', 1)
    )


def test_meshes_are_looked_for_beside_the_arena_and_beside_the_robot(
    tmp_path, monkeypatch
):
    elsewhere, robots = tmp_path / "elsewhere", tmp_path / "robots"
    for folder in (elsewhere, robots / "meshes"):
        folder.mkdir(parents=True)
    monkeypatch.chdir(elsewhere)
    mesh = robots / "meshes" / "hat.obj"
    mesh.write_text(TETRAHEDRON)
    robot = robots / "mine.xml"
    robot.write_text(with_mesh((MODELS / "epuck.xml").read_text()))
    scene = load_scene(str(robot), "pillars")
    assert scene.model.mesh(f"{PREFIX}hat").id == 0
    assert list(scene.sha256) == ["arena", "robot", "meshes/hat.obj", "../stage.xml"]
    findings = check_arena("pillars", [str(robot)]).findings
    assert Severity.ERROR not in {found.severity for found in findings}
    # a hash of every file that counts
    before = scene.sha256["meshes/hat.obj"]
    mesh.write_text(TETRAHEDRON.replace(".02", ".03"))
    assert load_scene(str(robot), "pillars").sha256["meshes/hat.obj"] != before
    mesh.unlink()
    assert "hat.obj" in refusal(robot=robot, arena="pillars")
    # not from wherever somebody happens to be
    (elsewhere / "meshes").mkdir()
    (elsewhere / "meshes" / "hat.obj").write_text(TETRAHEDRON)
    assert "hat.obj" in refusal(robot=robot, arena="pillars")


@pytest.mark.parametrize("robot", RUNGS)
def test_a_copied_arena_needs_no_copied_robot(tmp_path, robot):
    path = tmp_path / "copy.xml"
    path.write_text((MODELS / "arena.xml").read_text())
    assert load_scene(robot, str(path)).robot == MODELS / ROBOT_FILES[robot]


def refusal(robot="epuck", arena="arena", control_step=0.1) -> str:
    return refused(load_scene, str(robot), str(arena), control_step)


def edited(tmp_path, old: str, new: str, source: str = "epuck.xml"):
    """A copy of a shipped model with one thing changed."""
    text = (MODELS / source).read_text()
    assert old in text
    path = tmp_path / "edited.xml"
    path.write_text(text.replace(old, new))
    return path


def test_unknown_names_are_refused():
    assert refusal(robot="e-puck") == (
        "no robot 'e-puck': expected the path of an MJCF file or one of "
        "epuck_kinematic, epuck, epuck_cone_kinematic, epuck_cone"
    )
    assert "one of arena" in refusal(arena="no/such.xml")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('<rangefinder name="ps3" site="ps3"/>', "", "no sensor 'ps3'; available: ps0"),
        ('name="shell" geom1', 'name="bump" geom1', "no sensor 'shell'"),
        ('<geom name="shell"', "<geom", "edited.xml"),
        (
            '<freejoint name="base"/>',
            "",
            "expected body 'epuck' with a free joint, got none",
        ),
        (
            '<freejoint name="base"/>',
            '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
            '<joint axis="0 0 1"/>',
            "expected body 'epuck' with a free joint, got slide, slide, hinge",
        ),
        (
            '<rangefinder name="ps3" site="ps3"/>',
            '<gyro name="ps3" site="ps3"/>',
            "expected sensor 'ps3' to be a rangefinder",
        ),
        (
            '<velocity name="wheel_left"',
            '<velocity name="left"',
            "no actuator 'wheel_left'",
        ),
        ("<freejoint", "<freejoynt", "line"),
        ("</worldbody>", "", "edited.xml"),
    ],
)
def test_incomplete_robots_are_refused(tmp_path, old, new, expected):
    assert expected in refusal(robot=edited(tmp_path, old, new))


def test_broken_arenas_are_refused(tmp_path):
    path = tmp_path / "arena.xml"
    path.write_text("<mujoco>\n<worldbody>\n")
    assert "not well-formed XML" in refusal(arena=path)
    path.write_text(WALLS.replace('size="0.3 0.01 0.03"', 'sice="1"'))
    assert "'sice'" in refusal(arena=path)
    assert "line 7" in refusal(arena=path)
    path.write_bytes(b"\xff\xfe")
    assert "not well-formed" in refusal(arena=path)
    path.write_bytes(b"<mujoco>\xff</mujoco>")
    assert "cannot read" in refusal(arena=path)
    path.write_text('<mujoco><include file="gone.xml"/></mujoco>')
    assert "gone.xml" in refusal(arena=path)
    inline = (MODELS / "epuck.xml").read_text()
    path.write_text(inline)
    assert "line 44: an arena cannot define a body 'epuck'" in refusal(arena=path)


def test_control_step_is_a_multiple_of_the_physics_step():
    assert "0.033 s" in refusal(control_step=0.033)
    assert "0.001 s" in refusal(control_step=0.001)
    assert load_scene("epuck", "arena", 0.05).n_substeps == 5


FLOOR = '<geom name="floor" type="plane" size="1 1 0.1" contype="2" conaffinity="2"/>'


@pytest.mark.parametrize("robot", RUNGS)
def test_wheels_need_a_floor(tmp_path, robot):
    path = tmp_path / "arena.xml"
    assert FLOOR in WALLS
    path.write_text(WALLS.replace(FLOOR, ""))
    assert "has no floor for the robot's wheels" in refusal(robot, path)


@pytest.mark.parametrize("name", ON_WHEELS)
def test_a_file_with_a_kinematic_robots_name_is_refused(tmp_path, name):
    path = tmp_path / f"{name}.xml"
    path.write_text((MODELS / "epuck.xml").read_text())
    with pytest.raises(UserError, match="expected another file name"):
        load_scene(str(path), "arena")
