"""Any arena, the same robot: what an arena says of physics does not reach it."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from epuck_mj.check.arena import check_arena
from epuck_mj.errors import UserError
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import RUNGS, robots_in
from epuck_mj.rungs.watched_robot import WatchedRobot
from epuck_mj.scene.geometry import walls
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import MODELS
from epuck_mj.scene.robot_parts import PREFIX, SHELL
from epuck_mj.scene.sameness import check_same
from epuck_mj.scene.starts import survey
from epuck_mj.step.control import TaskParameters, drive
from evolution.judging.evaluation import DmControlEngine, Work

PLAIN = """<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1"/>
    <geom name="e" type="box" pos="0.41 0 0.03" size="0.01 0.42 0.03"/>
    <geom name="w" type="box" pos="-0.41 0 0.03" size="0.01 0.42 0.03"/>
    <geom name="n" type="box" pos="0 0.41 0.03" size="0.4 0.01 0.03"/>
    <geom name="s" type="box" pos="0 -0.41 0.03" size="0.4 0.01 0.03"/>
  </worldbody>
</mujoco>
"""

STARTS = np.array([[0.1, 0.05, 0.3], [-0.3, -0.2, 2.0], [0.2, -0.3, -1.5]])


def driven(robot: str, arena: Path) -> np.ndarray:
    """Poses of wall followers for five seconds."""
    robots = robots_in(load_scene(robot, str(arena)), len(STARTS), 1)
    steps = drive(robots, WallFollower(), robots.reset(STARTS), TaskParameters(50))
    return np.array([robots.poses() for _ in steps])


def with_head(*elements: str) -> str:
    return PLAIN.replace("<worldbody>", "\n".join(elements) + "\n<worldbody>", 1)


GLOBALS = {
    "euler": '<option integrator="Euler" timestep="0.002"/>',
    "coarse": '<option timestep="0.5"/>',
    "weightless": '<option gravity="0 0 0"/>',
    "tilted": '<option gravity="3 0 -9"/>',
    "wind": '<option wind="5 0 0" density="1000" viscosity="1"/>',
    "solver": '<option solver="PGS" iterations="1" cone="elliptic" impratio="9"/>',
    "flags": '<option><flag contact="disable" actuation="disable"/></option>',
    "sensors": '<option><flag sensor="disable" gravity="disable"/></option>',
    "sleep": '<option><flag sleep="enable" energy="enable"/></option>',
    "override": '<option o_margin=".05"><flag override="enable"/></option>',
    "groups": '<option actuatorgroupdisable="0 1 2"/>',
    "total mass": '<compiler settotalmass="1"/>',
    "bounds": '<compiler boundmass="1" boundinertia="0.1"/>',
    "balanced": '<compiler balanceinertia="true"/>',
    "from geoms": '<compiler inertiafromgeom="true"/>',
    "groups of inertia": '<compiler inertiagrouprange="3 3"/>',
    "angles": '<compiler angle="radian" eulerseq="zyx" autolimits="false"/>',
    "fused": '<compiler fusestatic="true" discardvisual="true"/>',
    "folders": '<compiler meshdir="a" texturedir="b" assetdir="c"/>',
    "joints": '<default><joint damping="9" armature="9" range="0 1"/></default>',
    "friction": '<default><geom friction="9" condim="6" solref=".5"/></default>',
    "forces": '<default><velocity forcerange="-1e-6 1e-6"/></default>',
    "gears": '<default><general gear="9" ctrlrange="0 1"/></default>',
    "a class": '<default><default class="epuck/wheel"/></default>',
    "memory": '<size memory="2K"/>',
    "keys": '<keyframe><key qpos="1 2 3"/></keyframe>',
    "margins": '<default><geom margin="0.02" gap="0.01"/></default>',
    "ice first": '<default><geom priority="3" friction="0"/></default>',
    "user data": '<size nuser_actuator="5" nuser_geom="2" nuser_sensor="3"/>',
}


@pytest.mark.parametrize("robot", RUNGS)
def test_nothing_global_reaches_the_robot(tmp_path, robot):
    plain = tmp_path / "plain.xml"
    plain.write_text(PLAIN)
    expected = driven(robot, plain)
    assert np.ptp(expected[..., :2]) > 0.3
    for name, element in GLOBALS.items():
        arena = tmp_path / "arena.xml"
        arena.write_text(with_head(element))
        # some move no bit of the model but what is drawn
        np.testing.assert_array_equal(driven(robot, arena), expected, name)


@pytest.mark.parametrize("robot", RUNGS)
@pytest.mark.parametrize("height", [-0.02, 0.012, 0.02])
def test_robots_stand_on_the_floor_that_is_there(tmp_path, robot, height):
    arena = tmp_path / "arena.xml"
    arena.write_text(PLAIN)
    expected = driven(robot, arena)
    floor = '<geom name="floor" type="plane" size="1 1 0.1"/>'
    board = f'<geom type="box" size=".5 .5 .01" pos="0 0 {height - 0.01}"/>'
    for ground in (floor.replace("/>", f' pos="0 0 {height}"/>'), board):
        arena.write_text(PLAIN.replace(floor, ground))
        scene = load_scene(robot, str(arena))
        assert scene.height == pytest.approx(height)
        # wheels roll on a box as on a plane, but not to the last bit: paths grow apart
        np.testing.assert_allclose(driven(robot, arena)[:6], expected[:6], atol=0.003)


def test_what_is_for_show_stays_for_rays(tmp_path):
    path = tmp_path / "arena.xml"
    show = '<geom name="paper" size=".02" contype="0" conaffinity="0"/>'
    body = f'<body pos="0 0 .03"><body>{show}</body></body></worldbody>'
    head = '<compiler discardvisual="true" fusestatic="false"/>'
    path.write_text(with_head(head).replace("</worldbody>", body))
    scene = load_scene("epuck", str(path))
    assert scene.model.geom("paper").bodyid == 0
    assert scene.model.body("epuck/epuck").id > 0


def test_a_low_wall_is_no_floor(tmp_path):
    path = tmp_path / "arena.xml"
    path.write_text(re.sub("0.03", "0.015", re.sub(".*floor.*", "", PLAIN)))
    assert "has no floor" in refusal(path)


def test_many_at_once_change_nothing_either(tmp_path):
    once = [e for name, e in GLOBALS.items() if name != "folders"]
    path = tmp_path / "arena.xml"
    path.write_text(with_head(*once))
    expected = tmp_path / "plain.xml"
    expected.write_text(PLAIN)
    np.testing.assert_array_equal(driven("epuck", path), driven("epuck", expected))


@pytest.mark.parametrize("field", ["body_mass", "dof_damping", "geom_friction"])
def test_a_robot_that_is_not_the_same_is_refused(field):
    model = load_scene("epuck", "arena").model
    arena = MODELS / "arena.xml"
    spec = mujoco.MjSpec.from_file(str(MODELS / "epuck.xml"))
    for sensor in spec.sensors:
        sensor.nsample = model.sensor_history[model.sensor(PREFIX + sensor.name).id, 0]
    alone = spec.compile()
    check_same(model, alone, arena)
    getattr(model, field)[-1] *= 1.1
    getattr(model, field)[-1] += 0.1
    with pytest.raises(UserError, match=f"changes the robot: {field} of"):
        check_same(model, alone, arena)
    model = load_scene("epuck", "arena").model
    model.opt.gravity[2] = -1
    with pytest.raises(UserError, match="changes the robot's option 'gravity'"):
        check_same(model, alone, arena)


def refusal(path: Path, robot: str = "epuck") -> str:
    with pytest.raises(UserError) as error:
        load_scene(robot, str(path))
    assert "\n" not in str(error.value)
    return str(error.value)


REFUSED = {
    "cellar": (
        PLAIN.replace('name="floor"', 'name="floor" pos="0 0 -0.1"'),
        "geom 'floor': a floor at height -100 mm",
    ),
    "no floor": (re.sub(".*floor.*", "", PLAIN), "has no floor"),
    "exclude": (
        with_head('<contact><exclude body1="world" body2="epuck"/></contact>'),
        "epuck",
    ),
    "leash": (
        with_head('<equality><weld body1="epuck"/></equality>'),
        "epuck",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_change_contacts_is_refused_by_name(tmp_path, name):
    text, expected = REFUSED[name]
    path = tmp_path / "arena.xml"
    path.write_text(text)
    assert expected in refusal(path)


def test_things_that_move_keep_their_floor(tmp_path):
    path = tmp_path / "arena.xml"
    ball = '<body pos="0.3 0.3 0.03"><freejoint/><geom size="0.02"/></body>'
    path.write_text(PLAIN.replace("</worldbody>", f"{ball}</worldbody>"))
    scene = load_scene("epuck", str(path))
    data = mujoco.MjData(scene.model)
    data.qpos[-7:] = scene.qpos(np.zeros(3))[-7:]
    mujoco.mj_step(scene.model, data, 200)
    assert data.xpos[1:, 2] == pytest.approx([0.02, 0, 0.0205, 0.0205], abs=0.002)
    assert not scene.reading(data.sensordata).contact
    # and robots have theirs: it is no wall that a shell could be too near to
    other = tmp_path / "plain.xml"
    other.write_text(PLAIN)
    assert not walls(scene.model)[scene.model.geom("floor").id]
    free = [survey(load_scene("epuck", str(p)), 0.01).inside for p in (path, other)]
    assert 0.9 * free[1].sum() < free[0].sum() < free[1].sum()


def test_a_maze_with_a_body_for_every_wall_has_room_in_memory(tmp_path):
    bricks = "".join(
        f'<body pos="{-0.39 + 0.02 * i} {-0.39 + 0.04 * j} .03">'
        '<geom type="box" size=".005 .005 .03"/></body>'
        for i in range(20)
        for j in range(20)
    )
    path = tmp_path / "arena.xml"
    path.write_text(PLAIN.replace("</worldbody>", f"{bricks}</worldbody>"))
    assert survey(load_scene("epuck", str(path)), 0.01).inside.any()
    assert np.isfinite(driven("epuck", path)).all()


def unstable(scene) -> None:
    """Make a robot that no physics can hold."""
    scene.model.dof_armature[:] = 1e-12
    scene.model.body_mass[:] = 1e-15
    scene.model.body_inertia[:] = 1e-18
    scene.model.actuator_gainprm[:, 0] = 1e12


class FullSpeed:
    """Controllers that drive straight on."""

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        return np.broadcast_to([1.0, 0.0], (len(observation), 2))

    def __len__(self) -> int:
        return 1

    def __getitem__(self, which: object) -> "FullSpeed":
        return self


def test_a_warning_of_mujoco_s_ends_a_trial_in_every_simulator(capfd):
    scene = load_scene("epuck", "arena")
    unstable(scene)
    full = np.full((1, 2), 6.0)
    for robots in (robots_in(scene, 1, 1), WatchedRobot(scene)):
        robots.reset(STARTS[:1])
        with pytest.raises(UserError, match=r"epuck.xml.*MuJoCo warns: \w+.*unstable"):
            for _ in range(20):
                robots.step(full)
    work = Work(FullSpeed(), STARTS[:1], None, None)
    engine = DmControlEngine(scene, TaskParameters(20))
    with pytest.raises(UserError, match="MuJoCo warns"):
        engine.run(work)
    assert capfd.readouterr() == ("", "")


FILES = {
    "attached": (
        '<asset><model name="m" file="sub/part.xml"/></asset>',
        '<frame pos=".1 .1 0"><attach model="m" body="p" prefix="one_"/></frame>',
        '<mujoco><worldbody><body name="p"><geom name="g" size=".04 .03" '
        'type="cylinder" pos="0 0 .03"/></body></worldbody></mujoco>',
    ),
    "nested includes": (
        "",
        '<include file="sub/outer.xml"/>',
        '<mujocoinclude><geom type="cylinder" size=".04 .03"/></mujocoinclude>',
    ),
    "nested model": (
        '<include file="sub/outer.xml"/>',
        "",
        "<mujoco><worldbody>"
        '<geom type="cylinder" size=".04 .03"/></worldbody></mujoco>',
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_files_are_found_from_the_file_that_names_them_and_hashed(
    tmp_path, monkeypatch, name
):
    head, body, part = FILES[name]
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "outer.xml").write_text(
        '<mujocoinclude><include file="part.xml"/></mujocoinclude>'
    )
    inner = tmp_path / "sub" / "part.xml"
    inner.write_text(part)
    path = tmp_path / "arena.xml"
    path.write_text(with_head(head).replace("</worldbody>", f"{body}</worldbody>"))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    scene = load_scene("epuck", str(path))
    assert (scene.model.geom_size == 0.04).any()
    assert "sub/part.xml" in scene.sha256
    # what is hashed is what is compiled: it can grow, but not unnoticed
    inner.write_text(part.replace(".04", ".05"))
    grown = load_scene("epuck", str(path))
    assert (grown.model.geom_size == 0.05).any()
    assert grown.sha256["sub/part.xml"] != scene.sha256["sub/part.xml"]
    others = {key: value for key, value in grown.sha256.items() if "part" not in key}
    assert others.items() <= scene.sha256.items()


def test_assets_of_all_kinds_are_hashed(tmp_path):
    from matplotlib.image import imsave

    folder = tmp_path / "pictures"
    folder.mkdir()
    imsave(folder / "wood.png", np.zeros((2, 2, 3)))
    imsave(tmp_path / "hills.png", np.zeros((4, 4)), cmap="gray")
    assets = (
        '<compiler texturedir="pictures"/><asset>'
        '<texture name="wood" type="2d" file="wood.png"/>'
        '<texture name="sky" type="skybox" fileright="wood.png" fileleft="wood.png"/>'
        '<hfield name="hills" file="hills.png" size="1 1 1 1"/></asset>'
    )
    path = tmp_path / "arena.xml"
    path.write_text(with_head(assets))
    names = set(load_scene("epuck", str(path)).sha256)
    assert {"pictures/wood.png", "hills.png"} <= names


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_every_encoding_that_a_file_declares_is_read(tmp_path, encoding):
    declared = {"utf-8-sig": "utf-8"}.get(encoding, encoding)
    text = f'<?xml version="1.0" encoding="{declared}"?>\n{PLAIN}'
    path = tmp_path / "arena.xml"
    path.write_bytes(text.replace('name="e"', 'name="östlich"').encode(encoding))
    scene = load_scene("epuck", str(path))
    assert scene.model.geom("östlich").id >= 0


def test_what_is_too_deep_or_defines_entities_is_refused_at_once(tmp_path):
    path = tmp_path / "arena.xml"
    path.write_text("<mujoco>" + "<body>" * 200_000)
    assert "at most 500 elements inside one another" in refusal(path)
    path.write_text('<!DOCTYPE m [<!ENTITY a "aa">]><mujoco>&a;</mujoco>')
    assert "no definitions of entities" in refusal(path)
    path.write_text(PLAIN.replace("0.41", "410").replace("0.42", "420"))
    assert load_scene("epuck", str(path)).model.geom(SHELL).id > 0
    (finding,) = (
        found for found in check_arena(str(path), ["epuck"]).findings if found.place
    )
    assert "are its lengths in millimetres?" in finding.text
