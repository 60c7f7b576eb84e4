"""The check of an arena: each finding by a bad arena and a good one, with its line."""

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.image import imread

from epuck_mj.check import picture, report
from epuck_mj.check.__main__ import check as check_command
from epuck_mj.check.arena import check_arena
from epuck_mj.check.findings import Severity
from epuck_mj.errors import UserError
from epuck_mj.scene.geometry import seen_by_rays
from epuck_mj.scene.model_files import MODELS
from tests.processes import PATIENCE

ROBOTS = ("epuck", "epuck_kinematic")
SHIPPED = [path.stem for path in sorted(MODELS.glob("arenas/*.xml"))] + ["arena"]

ARENA = """\
<mujoco>
  <option timestep="0.01" integrator="implicitfast"/>
  <asset>
    <material name="glass" rgba="1 1 1 0"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" contype="2" conaffinity="2"/>
    <geom name="east" type="box" pos="0.31 0 0.03" size="0.01 0.32 0.03"/>
    <geom name="west" type="box" pos="-0.31 0 0.03" size="0.01 0.32 0.03"/>
    <geom name="north" type="box" pos="0 0.31 0.03" size="0.3 0.01 0.03"/>
    <geom name="south" type="box" pos="0 -0.31 0.03" size="0.3 0.01 0.03"/>
    <!-- more -->
  </worldbody>
</mujoco>
"""
EAST, MORE = 8, 12
"""Lines of the eastern wall, and of what is added."""

EAST_GEOM = '<geom name="east" type="box" pos="0.31 0 0.03" size="0.01 0.32 0.03"/>'


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Nobody here needs to know how fast it is."""
    monkeypatch.setattr("epuck_mj.check.speed.MEASURED", 0.005)


@pytest.fixture
def check(tmp_path, monkeypatch, capsys):
    """Checks a text in a folder of its own: exit status and printed lines."""
    monkeypatch.chdir(tmp_path)

    def check(text: str, *arguments: str) -> tuple[int, list[str]]:
        Path("my.xml").write_text(text)
        status = check_command(["my.xml", *arguments])
        return status, capsys.readouterr().out.splitlines()

    return check


def with_more(xml: str) -> str:
    return ARENA.replace("<!-- more -->", xml)


def wrong(lines: list[str]) -> list[str]:
    return [line for line in lines if re.search(r": (error|warning): ", line)]


@pytest.mark.parametrize("arena", SHIPPED)
def test_shipped_arenas_have_nothing_wrong(arena):
    checked = check_arena(arena, ROBOTS)
    assert report.usable(checked.findings)
    # the end of its wall across is 20 mm thick
    warned = [f.text for f in checked.findings if f.severity is not Severity.INFO]
    assert all("too thin for single rays" in text for text in warned)
    assert len(warned) == (arena == "corridor")
    topics = list(dict.fromkeys(finding.topic for finding in checked.findings))
    assert topics == ["walls", "room", *(f"robot {robot}" for robot in ROBOTS)]


def test_a_good_arena_is_described(check):
    status, lines = check(ARENA)
    text = " ".join(" ".join(lines).split())
    assert status == 0
    assert "4 found: 4 of type box names: east, west, north, south" in text
    assert "box around them: x -0.320 to 0.320 m, y -0.320 to 0.320 m" in text
    # 0.6 m between walls, less twice radius and clearance
    area = re.search(r"robots may start on (\S+) m\^2", text)
    assert area
    assert float(area[1]) == pytest.approx((0.6 - 2 * 0.045) ** 2, abs=0.02)
    assert "1 region" in text
    for part in ("ps0 ", "ps7 ", "shell 0 contacts", "gyro", "velocimeter"):
        assert part in text
    assert "wheel_left -6.28 to 6.28" in text
    assert "touch: floor and wheel_left, floor and wheel_right" in text
    assert re.search(r"[\d,]+ physics steps/s; [\d,]+ control steps/s", text)
    assert "simulated s per CPU second" in text
    assert lines[-1] == "my.xml: usable; 0 errors, 0 warnings"
    assert max(map(len, lines)) <= 88


def test_one_robot_only(check):
    _, lines = check(ARENA, "--robot", "epuck_kinematic")
    assert "robot epuck_kinematic" in lines
    assert "robot epuck" not in lines


def east(text: str) -> str:
    return ARENA.replace(EAST_GEOM, text)


ERRORS = {
    "alpha of a geom": (
        east(EAST_GEOM.replace("/>", ' rgba="1 0 0 0"/>')),
        f'my.xml:{EAST}: error: <geom name="east">: rays cannot see it: alpha 0',
    ),
    "alpha of a material": (
        east(EAST_GEOM.replace("/>", ' rgba="1 0 0 1" material="glass"/>')),
        f'my.xml:{EAST}: error: <geom name="east">: rays cannot see it: alpha 0 of '
        "material 'glass'",
    ),
    "low wall": (
        with_more('<geom name="kerb" type="box" pos="0 0 .01" size=".05 .05 .01"/>'),
        f'my.xml:{MORE}: error: <geom name="kerb">: rays cannot see it: it ends at '
        "20.0 mm, rays run at 33.0 mm",
    ),
    "floating wall": (
        with_more('<geom name="bar" type="box" pos="0 0 .06" size=".05 .05 .02"/>'),
        f'my.xml:{MORE}: error: <geom name="bar">: rays cannot see it: it begins at '
        "40.0 mm, rays run at 33.0 mm",
    ),
    "height field": (
        with_more('<geom type="hfield" hfield="hills" pos="0.2 0.2 0"/>').replace(
            "</asset>",
            '<hfield name="hills" nrow="2" ncol="2" size=".1 .1 .05 .01" '
            'elevation="0 1 1 0"/></asset>',
        ),
        f"my.xml:{MORE}: error: <geom>: a wall cannot be of type hfield",
    ),
    "no floor": (
        "\n".join(line for line in ARENA.splitlines() if "floor" not in line),
        "has no floor for the robot's wheels",
    ),
    "floor too low": (
        ARENA.replace('<geom name="floor"', '<geom name="floor" pos="0 0 -0.1"'),
        'my.xml:7: error: <geom name="floor">: a floor at height -100 mm; expected 0',
    ),
    "floor too high": (
        with_more('<geom name="attic" type="plane" size="1 1 1" pos="0 0 0.2"/>'),
        f'my.xml:{MORE}: error: <geom name="attic">: a floor at height 200 mm',
    ),
    "mat on a floor": (
        with_more('<geom name="mat" type="box" size=".3 .3 .004" pos="0 0 .004"/>'),
        f'my.xml:{MORE}: error: <geom name="mat">: no room for a start: it is in the ',
    ),
    "slab below the shell": (
        with_more('<geom name="slab" type="box" pos="0 0 0" size=".1 .1 .001"/>'),
        f'my.xml:{MORE}: error: <geom name="slab">: it lies below the shell',
    ),
    "ramp": (
        with_more(
            '<geom name="ramp" type="box" size=".3 .3 .01" pos="0 0 0" '
            'euler="0 5 0" contype="2" conaffinity="2"/>'
        ),
        "robots do not stay where they are put",
    ),
    "toy that no physics can hold": (
        with_more(
            '<body name="toy" pos="0 0 .2"><joint type="slide" stiffness="1e7" '
            'springref=".01"/><geom size=".01" mass=".001"/></body>'
        ),
        "error: what moves, body 'toy', cannot be simulated with a step of 0.01 s, ",
    ),
    "cloth": (
        with_more(
            '<flexcomp name="cloth" type="grid" count="3 3 1" spacing=".05 .05 .05" '
            'pos="0 0 .1" dim="2"/>'
        ),
        "has a flex, 'cloth'",
    ),
    "hollow mesh": (
        with_more('<geom type="mesh" mesh="l" pos="-.1 -.1 0"/>').replace(
            "</asset>",
            '<mesh name="l" vertex="0 0 0 .1 0 0 .1 .02 0 .02 .02 0 .02 .1 0 0 .1 0 '
            '0 0 .1 .1 0 .1 .1 .02 .1 .02 .02 .1 .02 .1 .1 0 .1 .1" '
            'face="0 2 1 0 3 2 0 4 3 0 5 4 6 7 8 6 8 9 6 9 10 6 10 11 '
            "0 1 7 0 7 6 1 2 8 1 8 7 2 3 9 2 9 8 3 4 10 3 10 9 4 5 11 4 11 10 "
            '5 0 6 5 6 11"/></asset>',
        ),
        f"my.xml:{MORE}: error: <geom>: rays cannot see it: where the shell touches it",
    ),
    "gap": (
        east(""),
        "my.xml: error: the walls enclose nothing: expected walls all around",
    ),
    "door": (
        east(EAST_GEOM.replace("0.31 0 0.03", "0.31 0.14 0.03")),
        "my.xml: error: the walls enclose nothing: there is a way out about 0.1",
    ),
    "no room": (
        re.sub(r"0\.31", "0.045", ARENA),
        "my.xml: error: no room for a start",
    ),
    "no walls": (
        re.sub(r".*type=\"box\".*\n", "", ARENA),
        "my.xml: error: the arena has no walls: expected geoms fixed to the world",
    ),
    "nowhere": (
        with_more('<geom type="box" pos="1e30 0 0" size="1 1 1"/>'),
        f"my.xml:{MORE}: error: <geom>: expected finite numbers",
    ),
    "robot of its own": (
        with_more('<body name="epuck"/>'),
        f'my.xml:{MORE}: error: <body name="epuck">: an arena cannot define a body ',
    ),
    "attribute": (
        with_more('<geom sise=".1"/>'),
        f"my.xml:{MORE}: error: <geom>: MuJoCo: Schema violation: unrecognized "
        "attribute: 'sise'",
    ),
    "element": (with_more("<goem/>"), f"my.xml:{MORE}: error: <goem>: MuJoCo: "),
    "size": (with_more('<geom size="-1"/>'), f"my.xml:{MORE}: error: <geom>: MuJoCo: "),
    "class": (
        with_more('<geom class="wall" size="1"/>'),
        f'my.xml:{MORE}: error: <geom class="wall">: MuJoCo: unknown default class',
    ),
    "mesh": (
        with_more('<geom type="mesh" mesh="no"/>'),
        f"my.xml:{MORE}: error: <geom>: MuJoCo: mesh 'no' not found",
    ),
    "file": (
        ARENA.replace("<asset>", '<asset><mesh name="m" file="no.stl"/>'),
        "my.xml:3: error: <mesh name=\"m\">: no file 'no.stl'",
    ),
    "include that is not there": (
        ARENA.replace("<asset>", '<include file="walls.xml"/><asset>'),
        'my.xml:3: error: <include file="walls.xml">: no file ',
    ),
    "include of nothing": (
        ARENA.replace("<asset>", "<include/><asset>"),
        "my.xml:3: error: <include>: no file ",
    ),
    "tag": (
        ARENA.replace("</asset>", "</assets>"),
        "my.xml:5: error: not well-formed XML: mismatched tag",
    ),
    "half a file": (ARENA[:300], "error: not well-formed XML: "),
    "no file at all": ("", "my.xml:1: error: not well-formed XML: no element found"),
    "not XML": ("{}", "my.xml:1: error: not well-formed XML: "),
    "another root": ("<robot>\n</robot>", "has no floor for the robot's wheels"),
    "empty root": ("<mujoco/>", "has no floor for the robot's wheels"),
}


@pytest.mark.parametrize("name", ERRORS)
def test_errors_name_the_line(check, name):
    text, expected = ERRORS[name]
    # the robot with wheels: it needs a floor as well
    status, lines = check(text, "--robot", "epuck")
    found = wrong(lines)
    assert status == 1
    assert any(expected in line for line in found), found
    assert "not usable" in lines[-1]


WARNINGS = {
    "ghost": (
        with_more('<geom size=".05" pos="0 0 .03" contype="0" conaffinity="0"/>'),
        f"my.xml:{MORE}: warning: <geom>: rays see it, but the shell cannot hit it",
    ),
    "lamp": (
        with_more('<geom name="lamp" size=".05" pos="0 0 .5"/>'),
        f'my.xml:{MORE}: warning: <geom name="lamp">: the robot passes below it',
    ),
    "cellar": (
        with_more('<geom size=".05" pos="0 0 -.5"/>'),
        f"my.xml:{MORE}: warning: <geom>: the robot passes above it",
    ),
    "ball": (
        with_more('<body pos="0 0 .05"><freejoint/><geom size=".05"/></body>'),
        f"my.xml:{MORE}: warning: <body>: it moves, so it is no wall: touching it",
    ),
    "robot of many parts": (
        with_more(
            '<body name="r" pos="0 0 .02"><freejoint/><geom size=".01"/><body>'
            '<joint/><geom size=".01" pos=".02 0 0"/></body></body>'
        ),
        f'my.xml:{MORE}: warning: <body name="r">: it moves, so it is no wall: ',
    ),
    "leaning wall": (
        east(
            '<geom name="east" type="box" pos="0.36 0 0.05" size="0.01 0.32 0.12" '
            'euler="0 30 0"/>'
        ),
        f'my.xml:{EAST}: warning: <geom name="east">: rays see a wall ',
    ),
    "post": (
        with_more('<geom name="post" type="cylinder" size=".012 .03" pos="0 0 .03"/>'),
        f'my.xml:{MORE}: warning: <geom name="post">: too thin for single rays',
    ),
    "end of a wall": (
        with_more('<geom type="box" size=".1 .01 .03" pos="-.2 0 .03"/>'),
        f"my.xml:{MORE}: warning: <geom>: too thin for single rays",
    ),
    "two rooms": (
        with_more('<geom type="box" pos="0 0 .03" size=".01 .3 .03"/>'),
        "my.xml: warning: 2 separate regions of 0.1",
    ),
}


@pytest.mark.parametrize("name", WARNINGS)
def test_warnings_name_the_line_and_leave_the_arena_usable(check, name):
    text, expected = WARNINGS[name]
    status, lines = check(text)
    found, refused = [], []
    for line in wrong(lines):
        (refused if "--robot epuck simulates it" in line else found).append(line)
    assert len(found) == 1, found
    assert found[0].startswith(expected)
    # what moves has no place in a plan
    assert len(refused) == ("it moves" in expected)
    warnings = f"{1 + len(refused)} warning{'s' * len(refused)}"
    assert (status, lines[-1]) == (0, f"my.xml: usable; 0 errors, {warnings}")


GOOD = {
    # rays pass, robots do not
    "narrow gap": east(EAST_GEOM.replace("0.01 0.32", "0.01 0.29")),
    "half transparent": east(EAST_GEOM.replace("/>", ' rgba="1 0 0 0.1"/>')),
    "hidden group": east(EAST_GEOM.replace("/>", ' group="5"/>')),
    # a material's alpha counts before the geom's
    "paint": with_more(
        '<geom type="box" size=".02 .02 .03" pos="0 0 .03" material="red"/>'
    ).replace("</asset>", '<material name="red" rgba="1 0 0 1"/></asset>'),
    "marks on the floor": with_more(
        '<geom type="box" size=".1 .1 .0001" contype="0" conaffinity="0"/>'
    ),
    "convex mesh": with_more('<geom type="mesh" mesh="m" pos="0 0 0"/>').replace(
        "</asset>",
        '<mesh name="m" vertex="0 0 0 .1 0 0 0 .1 0 .1 .1 0 '
        '0 0 .1 .1 0 .1 0 .1 .1 .1 .1 .1"/></asset>',
    ),
    # what counts is what is met along the outline
    "cap on a wall": with_more(
        '<geom type="box" size=".01 .32 .005" pos=".31 0 .065" rgba="1 0 0 1"/>'
        '<geom type="box" size=".01 .32 .004" pos="-.31 0 .046" rgba="1 0 0 1"/>'
    ),
    "skirting": with_more('<geom type="box" size=".005 .3 .008" pos=".296 0 .008"/>'),
    "stacked bricks": east(
        "".join(
            f'<geom type="box" pos="0.31 0 {z}" size="0.01 0.32 0.006"/>'
            for z in (0.006, 0.018, 0.03, 0.042, 0.054)
        )
    ),
    "paper on a wall": with_more(
        '<geom type="box" size=".001 .1 .03" pos=".299 0 .03" contype="0" '
        'conaffinity="0"/>'
    ),
    "plane as a wall": east(
        '<geom type="plane" pos="0.3 0 0" size="1 1 1" zaxis="-1 0 0"/>'
    ),
    "post that rays do see": with_more(
        '<geom type="cylinder" size=".016 .03" pos="0 0 .03"/>'
    ),
    "floor with the bits of a wall": ARENA.replace(' contype="2" conaffinity="2"', ""),
    "floor that is for show": ARENA.replace(
        'contype="2" conaffinity="2"', 'contype="0" conaffinity="0"'
    ),
    "floor of a box with the bits of a wall": ARENA.replace(
        'type="plane" size="1 1 1" contype="2" conaffinity="2"',
        'type="box" size="1 1 .01" pos="0 0 -.01"',
    ),
    "board": ARENA.replace(
        'type="plane" size="1 1 1" contype="2" conaffinity="2"',
        'type="box" size=".33 .33 .006" pos="0 0 .006"',
    ),
    "plane somewhat lower": ARENA.replace(
        '<geom name="floor"', '<geom name="floor" pos="0 0 -0.002"'
    ),
    "margin": east(EAST_GEOM.replace("/>", ' margin="0.01" gap="0.01"/>')),
    "priority": ARENA.replace('size="1 1 1"', 'size="1 1 1" priority="2"'),
    "planes for show above, and one to fall on far below": with_more(
        '<geom type="plane" size=".1 .1 1" pos="0 0 .5" contype="0" conaffinity="0"/>'
        '<geom type="plane" size="9 9 1" pos="0 0 -.5"/>'
    ),
    "space in the last tag": ARENA.replace("</mujoco>", "</mujoco >"),
    "comment behind the root": ARENA + "<!-- </mujoco> -->",
    "names of the robot's": with_more(
        '<geom name="shell" size=".05" pos="0 0 .03"/><camera name="chase"/>'
    ).replace(
        "<asset>", '<default><default class="epuck"><geom/></default></default><asset>'
    ),
    "floor of a box with the right bits": ARENA.replace(
        'type="plane" size="1 1 1"', 'type="box" size="1 1 .01" pos="0 0 -.01"'
    ),
}


@pytest.mark.parametrize("name", GOOD)
def test_no_false_alarm(check, name):
    status, lines = check(GOOD[name])
    assert (status, wrong(lines)) == (0, [])


def test_the_same_of_many_is_said_once(check):
    post = '<geom name="p{}" type="cylinder" size=".01 .03" pos="{} {} .03"/>'
    places = [(x, y) for x in (-0.15, 0, 0.15) for y in (-0.15, 0, 0.15)]
    posts = "\n".join(post.format(i, x, y) for i, (x, y) in enumerate(places))
    status, lines = check(with_more(posts))
    found = wrong(lines)
    assert (status, lines[-1]) == (0, "my.xml: usable; 0 errors, 9 warnings")
    assert len(found) == report.ALIKE_MAX + 1
    assert all("too thin for single rays" in line for line in found[:-1])
    assert found[-1].endswith(
        'the same of 6 more: <geom name="p3">, <geom '
        'name="p4">, <geom name="p5">, <geom name="p6">, '
        '<geom name="p7">, <geom name="p8">'
    )


def test_what_is_said_of_physics_and_not_used_is_listed(check):
    text = ARENA.replace('size="1 1 1"', 'size="1 1 1" margin=".01" priority="2"')
    text = text.replace('gravity="', "").replace(
        "<asset>", "<size memory='1M'/><asset>"
    )
    _, lines = check(text)
    said = " ".join(" ".join(lines).split())
    assert "not used, since the robot brings its own physics: <option> of line 2, " in (
        said
    )
    assert "margin of geoms (line 7), priority of geoms (line 7)" in said


def test_the_height_of_a_board_is_said(check):
    _, lines = check(GOOD["board"])
    assert '  robots stand at height 12.0 mm: on <geom name="floor">' in lines


def test_walls_with_the_bits_of_others_are_named(check):
    bits = 'contype="0" conaffinity="2"'
    status, lines = check(ARENA.replace('0.03"/>', f'0.03" {bits}/>'))
    found = wrong(lines)
    assert status == 1
    assert "expected 1 of a wall" in found[0]
    assert found[0].startswith(f'my.xml:{EAST}: warning: <geom name="east">: rays see')
    assert "has no walls" in found[-1]


def test_lines_of_attached_models_are_those_of_their_files(check, tmp_path):
    (tmp_path / "part.xml").write_text(
        '<mujoco>\n<worldbody>\n<body name="p">\n'
        '<geom name="g" type="cylinder" size=".01 .03" pos="0 0 .03"/>'
        "</body></worldbody></mujoco>"
    )
    text = ARENA.replace("<asset>", '<asset><model name="m" file="part.xml"/>')
    text = text.replace("<!-- more -->", '<attach model="m" body="p" prefix="a_"/>')
    _, lines = check(text)
    (line,) = wrong(lines)
    assert line.startswith('part.xml:4: warning: <geom name="g">: too thin for single')


def test_lines_within_replicates_frames_and_includes(check, tmp_path):
    ghosts = 'contype="0" conaffinity="0"'
    (tmp_path / "more.xml").write_text(
        "<mujoco>\n <worldbody>\n"
        f'  <geom name="far" size=".02" pos="0.1 0.1 .03" {ghosts}/>\n'
        " </worldbody>\n</mujoco>\n"
    )
    text = ARENA.replace("<asset>", '<include file="more.xml"/>\n<asset>')
    text = text.replace(
        "<!-- more -->",
        '<replicate count="2" euler="0 0 90">\n'
        f'<geom name="r" size=".02" pos="0.1 0 .03" {ghosts}/>\n</replicate>\n'
        f'<frame pos="-.1 0 .03">\n<geom size=".02" {ghosts}/>\n</frame>\n'
        f'<body pos="0 -0.1 0.03">\n<geom size=".02" {ghosts}/></body>\n',
    )
    status, lines = check(text)
    places = [line.split(": warning: ") for line in wrong(lines)]
    assert status == 0
    assert {(place, said.split(": ")[0]) for place, said in places} == {
        ("more.xml:3", '<geom name="far">'),
        ("my.xml:14", '<geom name="r">'),
        ("my.xml:17", "<geom>"),
        ("my.xml:20", "<geom>"),
    }


def test_errors_in_included_files_have_their_line(check, tmp_path):
    text = ARENA.replace("<asset>", '<include file="more.xml"/>\n<asset>')
    for content, expected in [
        ('<mujoco>\n<worldbody>\n<geom sise="1"/></worldbody></mujoco>', ":3: error: "),
        ("<mujoco>\n\n\n<worldbody></mujoco>", ":4: error: not well-formed XML"),
        ('<mujoco>\n<include file="a.xml"/></mujoco>', ":2: error: <include file="),
    ]:
        (tmp_path / "more.xml").write_text(content)
        status, lines = check(text)
        assert status == 1
        assert [line.startswith(f"more.xml{expected}") for line in wrong(lines)] == [
            True
        ], lines
    twice = ARENA.replace("<asset>", '<include file="b.xml"/>' * 2 + "<asset>")
    (tmp_path / "b.xml").write_text("<mujoco/>")
    assert "already included" in wrong(check(twice)[1])[0]


def test_an_arena_may_include_its_robot(check, tmp_path):
    """Even one that is not there: it is replaced."""
    text = ARENA.replace("<asset>", '<include file="epuck.xml"/><asset>')
    assert check(text)[0] == 0
    (tmp_path / "mine.xml").write_text((MODELS / "epuck.xml").read_text())
    text = ARENA.replace("<asset>", '<include file="mine.xml"/><asset>')
    assert check(text)[0] == 0


def test_what_rays_see_is_what_mujoco_casts():
    """The rule against real rays, over every way to be invisible."""
    looks = [
        f'rgba="1 0 0 {alpha}" {material} group="{group}" contype="{bits}"'
        for alpha in (0, 0.01, 1)
        for material in ("", 'material="glass"', 'material="solid"')
        for group in (0, 5)
        for bits in (0, 1)
    ]
    looks += ["", 'material="glass"', 'class="ghost"']
    geoms = "".join(f'<geom size=".1" pos="1 {i} 0" {x}/>' for i, x in enumerate(looks))
    sites = "".join(
        f'<site name="s{i}" pos="0 {i} 0" zaxis="1 0 0"/>' for i in range(len(looks))
    )
    rays = "".join(f'<rangefinder site="s{i}"/>' for i in range(len(looks)))
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco>
        <default><default class="ghost"><geom rgba="1 1 1 0"/></default></default>
        <asset><material name="glass" rgba="1 1 1 0"/><material name="solid"/></asset>
        <worldbody>{geoms}<body name="eyes">{sites}</body></worldbody>
        <sensor>{rays}</sensor></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(data.sensordata >= 0, seen_by_rays(model))
    assert seen_by_rays(model).any()
    assert not seen_by_rays(model).all()


def test_the_gap_is_where_it_is_and_as_wide(check):
    """A hole of 0.2 m in the north: from x = 0 to x = 0.2."""
    north = '<geom name="north" type="box" pos="0 0.31 0.03" size="0.3 0.01 0.03"/>'
    parts = north.replace('"0 0.31', '"-0.15 0.31').replace('"0.3 0.01', '"0.15 0.01')
    parts += (
        parts.replace('"-0.15', '"0.25')
        .replace('"0.15', '"0.05')
        .replace("north", "rest")
    )
    assert north in ARENA
    _, lines = check(ARENA.replace(north, parts))
    (line,) = wrong(lines)
    gap = re.search(r"way out about (\S+) m wide near x (\S+) m, y (\S+) m", line)
    assert gap, line
    width, x, y = (float(number) for number in gap.groups())
    assert width == pytest.approx(0.2, abs=0.03)
    assert (x, y) == (pytest.approx(0.1, abs=0.03), pytest.approx(0.31, abs=0.05))


def test_picture_shows_walls_and_region(check, monkeypatch):
    figures, drawn = [], picture.region_figure

    def kept(*arguments):
        figures.append(drawn(*arguments))
        return figures[-1]

    monkeypatch.setattr("epuck_mj.check.picture.region_figure", kept)
    status, lines = check(ARENA, "--picture", "region.png")
    assert (status, lines[-1]) == (0, "picture: region.png")
    pixels = imread("region.png")[..., :3]
    green = (pixels[..., 1] > pixels[..., 0] + 0.2).mean()
    grey = (np.abs(pixels - 0.45) < 0.01).all(axis=-1).mean()
    assert 0.2 < green < 0.8
    assert grey > 0.02
    (legend,) = figures[0].legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["robot's middle may start", "walls", "robot's size"]
    # one that leaks shows how
    status, lines = check(ERRORS["door"][0], "--picture", "leak.png")
    assert (status, lines[-1]) == (1, "picture: leak.png")
    pixels = imread("leak.png")[..., :3]
    assert (pixels[..., 0] > pixels[..., 2] + 0.2).mean() > 0.2
    _, lines = check("<mujoco/>", "--picture", "none.png")
    assert not Path("none.png").exists()
    assert lines[-1] == "no picture: there are no walls to draw"
    with pytest.raises(UserError, match=r"--picture: expected .* \.png, got 'my\.xml'"):
        check(ARENA, "--picture", "my.xml")
    with pytest.raises(UserError, match="cannot write"):
        check(ARENA, "--picture", "no/folder.png")


def test_bad_command_lines_are_one_line(tmp_path, capsys):
    binary = tmp_path / "binary.xml"
    binary.write_bytes(b"\xff\xfe\x00<mujoco>")
    arena = tmp_path / "arena.xml"
    arena.write_text(ARENA)
    robot = tmp_path / "robot.xml"
    robot.write_text("<mujoco><worldbody/></mujoco>")
    for arguments, message in [
        ((tmp_path,), "no arena"),
        ((), "expected ARENA, got none"),
        ((binary,), "cannot read"),
        ((arena, "--robot", "r2d2"), "no robot 'r2d2'"),
        ((arena, "--robot", robot), "robot.xml"),
        ((arena, "--colour", "red"), "--colour"),
    ]:
        with pytest.raises(UserError) as error:
            check_command([str(argument) for argument in arguments])
        assert "\n" not in str(error.value)
        assert message in str(error.value)
        assert capsys.readouterr() == ("", "")


def test_a_process_with_bad_input_has_status_2():
    result = subprocess.run(
        [sys.executable, "-m", "epuck_mj.check", "moon"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        cwd=MODELS.parent,
    )
    assert (result.returncode, result.stdout) == (2, "")
    assert re.fullmatch(r"error: no arena 'moon'[^\n]*\n", result.stderr)


@pytest.mark.parametrize("seed", range(12))
def test_no_damage_ends_in_a_traceback(check, seed):
    """Characters of a good file deleted, doubled or changed at random."""
    rng = np.random.default_rng(seed)
    text = list(ARENA)
    for _ in range(rng.integers(1, 4)):
        at = rng.integers(len(text))
        text[at] = rng.choice(["", text[at] * 2, "<", '"', "-", "0", "9", "e", "&"])
    try:
        status, lines = check("".join(text), "--robot", "epuck")
    except UserError as problem:
        assert "\n" not in str(problem)
        return
    assert status == int(" error: " in "\n".join(lines))
