"""The shipped arenas: walls only, and room in all of them for any robot."""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy import spatial

from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import MODELS
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import START_CLEARANCE, TaskParameters
from evolution.judging.held_out import Judge

ARENAS = sorted(MODELS.glob("arenas/*.xml"))

arenas = pytest.mark.parametrize("path", ARENAS, ids=lambda path: path.stem)


def test_there_is_an_arena_of_each_kind():
    assert {path.stem for path in ARENAS} == {
        "small_square",
        "large_square",
        "rectangle",
        "l_shape",
        "round",
        "octagon",
        "corridor",
        "pillars",
        "convex_corner",
    }


@arenas
def test_it_holds_walls_and_nothing_else(path: Path):
    root = ET.parse(path).getroot()
    assert root.get("model") == path.stem
    assert [child.tag for child in root] == ["include", "include", "worldbody"]
    assert {child.get("file") for child in root[:2]} == {"../epuck.xml", "../stage.xml"}
    for element in root[2].iter():
        assert element.tag in ("worldbody", "replicate", "geom")
        assert element.tag != "geom" or element.get("class") == "wall"
    assert len(path.read_text().splitlines()) < 20


@arenas
def test_mujoco_and_every_robot_load_it(path: Path):
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.opt.timestep == 0.01
    for robot in RUNGS:
        scene = load_scene(robot, path.stem)
        assert scene.arena == path
        assert set(scene.sha256) == {"arena", "robot", "../stage.xml"}


@arenas
@pytest.mark.parametrize("robot", RUNGS)
def test_starts_touch_nothing_and_reach_all_of_the_free_space(path: Path, robot: str):
    scene = load_scene(robot, path.stem)
    space = FreeSpace(scene, START_CLEARANCE)
    starts = space.sample(np.random.default_rng(0), 1000)
    assert ClearanceProbe(scene, 1).measure(starts).distance.min() > (
        START_CLEARANCE - 1e-4
    )
    grid = space.grid
    nodes = grid.nodes[grid.inside]
    far, _ = spatial.KDTree(starts[:, :2]).query(nodes)
    # 1,000 starts in two square metres lie a few centimetres apart
    assert far.max() < 0.17


@arenas
def test_the_hand_written_follower_follows_its_walls(path: Path):
    scene = load_scene("epuck_kinematic", path.stem)
    judge = Judge(scene, FreeSpace(scene, START_CLEARANCE), TaskParameters(), 1)
    test = judge.test(WallFollower(), 100)
    assert test.behaviour["wall follower"] + test.behaviour["hugger"] >= 0.75
    assert test.metrics["laps"] is not None
    assert test.metrics["laps"] > 0.3
