"""Recordings: the .rrd read back agrees with the trajectory; pictures are drawn."""

import ctypes.util
import json
import os
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.image import imread
from rerun.chunk import RrdReader

from epuck_mj.control import TaskParameters
from epuck_mj.controller import ControllerFile, Network
from epuck_mj.errors import UserError
from epuck_mj.geometry import arena_box, color, drawn
from epuck_mj.model import load_scene
from epuck_mj.recording import save_recording, shapes
from epuck_mj.trajectory import record

TASK = TaskParameters(steps=40)
START = np.array([0.4, 0.1, 0.4])
RERUN = Path(sys.executable).with_name("rerun")


@pytest.fixture(autouse=True)
def strict(monkeypatch):
    """Errors of rerun raise, and nothing calls home."""
    for name, value in {"CI": "1", "RERUN_STRICT": "1", "RUST_LOG": "error"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("RERUN", raising=False)


def straight_on(observation):
    """Full speed ahead: crashes into the east wall."""
    action = np.zeros((*observation.shape[:-1], 2))
    action[..., 0] = 1.0
    return action


@pytest.fixture(scope="module")
def scene():
    return load_scene("epuck", "arena", TASK.control_step)


@pytest.fixture(scope="module")
def trajectory(scene):
    return record(scene, straight_on, START, TASK)


@pytest.fixture
def path(scene, trajectory, tmp_path):
    path = tmp_path / "trial.rrd"
    save_recording(path, scene, trajectory, TASK, "a title", "# A *summary*")
    return path


def entities(path):
    """Rows of every entity: static ones and those in time, as lists of batches."""
    found = {}
    for chunk in RrdReader(path).stream().to_chunks():
        key = chunk.entity_path, chunk.is_static
        found.setdefault(key, []).append(chunk.to_record_batch())
    return found


def column(path, entity, component, static=False):
    """One component of an entity as nested lists, one per row."""
    rows = []
    for batch in entities(path)[entity, static]:
        for name in batch.schema.names:
            if name.endswith(component):
                rows += batch.column(name).to_pylist()
    return rows


def timeline(path, entity, name):
    (batch,) = entities(path)[entity, False]
    return batch.column(name).cast("int64").to_numpy()


def test_the_file_is_sound_small_and_alone(path):
    result = subprocess.run(
        [RERUN, "rrd", "verify", path], capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 0, result.stderr
    assert path.stat().st_size < 1_000_000
    assert list(path.parent.iterdir()) == [path]
    reader = RrdReader(path)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    assert reader.recordings()[0].application_id == "epuck_mj"


def test_entities_rows_and_timelines(path, scene, trajectory):
    steps = trajectory.steps
    expected = {
        "/world/epuck": (0, steps + 1),
        "/world/wheel_left": (0, steps + 1),
        "/world/wheel_right": (0, steps + 1),
        "/trial/path": (1, steps),
        "/trial/rays": (0, steps + 1),
        "/trial/crash": (steps, 1),
        "/plot/observation": (0, steps + 1),
        "/plot/action": (0, steps),
        "/plot/command": (0, steps),
        "/plot/step_fitness": (1, steps),
        "/plot/cumulative_fitness": (1, steps),
    }
    found = entities(path)
    in_time = {entity for entity, static in found if not static}
    assert in_time == set(expected)
    for entity, (first, rows) in expected.items():
        step = timeline(path, entity, "step")
        np.testing.assert_array_equal(step, np.arange(first, first + rows))
        # whole nanoseconds: floats would be cut off
        sim_time = timeline(path, entity, "sim_time")
        np.testing.assert_array_equal(sim_time, step * 100_000_000)
    geoms = np.flatnonzero(drawn(scene.model))
    static = {entity for entity, is_static in found if is_static}
    logged = [entity for entity in static if entity.startswith("/world/")]
    names = [scene.model.geom(geom).name or f"geom{geom}" for geom in geoms]
    assert sorted(entity.split("/")[-1] for entity in logged) == sorted(names)
    assert {entity.split("/")[2] for entity in logged} == {
        "arena",
        "epuck",
        "wheel_left",
        "wheel_right",
    }
    summary = column(path, "/summary", "TextDocument:text", static=True)
    assert summary == [["# A *summary*"]]


def test_plots_hold_the_trajectory(path, trajectory):
    for entity, values in {
        "observation": trajectory.observation,
        "action": trajectory.action,
        "command": trajectory.command,
        "step_fitness": trajectory.fitness[:, None],
        "cumulative_fitness": trajectory.cumulative_fitness[:, None],
    }.items():
        rows = column(path, f"/plot/{entity}", "Scalars:scalars")
        np.testing.assert_array_equal(rows, values)


def test_robot_path_and_crash_are_where_the_robot_was(path, trajectory):
    position = np.array(column(path, "/world/epuck", "Transform3D:translation"))[:, 0]
    np.testing.assert_allclose(position[:, :2], trajectory.pose[:, :2], atol=1e-6)
    x, y, z, w = np.array(column(path, "/world/epuck", "Transform3D:quaternion"))[
        :, 0
    ].T
    np.testing.assert_allclose(x**2 + y**2, 0, atol=1e-6)
    yaw = 2 * np.arctan2(z, w)
    np.testing.assert_allclose(np.sin(yaw - trajectory.pose[:, 2]), 0, atol=1e-6)
    strips = np.array(column(path, "/trial/path", "LineStrips3D:strips"))[:, 0]
    np.testing.assert_allclose(strips[:, 0, :2], trajectory.pose[:-1, :2], atol=1e-6)
    np.testing.assert_allclose(strips[:, 1, :2], trajectory.pose[1:, :2], atol=1e-6)
    crash = np.array(column(path, "/trial/crash", "Points3D:positions"))
    np.testing.assert_allclose(crash[0, 0, :2], trajectory.pose[-1, :2], atol=1e-6)


def test_rays_are_as_long_as_what_they_measured(path, trajectory):
    rays = np.array(column(path, "/trial/rays", "LineStrips3D:strips"))
    length = np.linalg.norm(rays[:, :, 1] - rays[:, :, 0], axis=-1)
    np.testing.assert_allclose(
        length, trajectory.observation * TASK.sensor_range, atol=1e-6
    )
    # they leave the robot: every end is farther from its axis than its origin
    radius = np.linalg.norm(rays[..., :2] - trajectory.pose[:, None, None, :2], axis=-1)
    assert (radius[:, :, 1] >= radius[:, :, 0] - 1e-6).all()


def test_a_trial_without_crash_has_no_mark(scene, tmp_path):
    task = TaskParameters(steps=3)
    path = tmp_path / "trial.rrd"
    free = record(scene, straight_on, np.zeros(3), task)
    save_recording(path, scene, free, task, "", "")
    assert not any("crash" in entity for entity, _ in entities(path))


def test_two_files_of_a_trial_say_the_same(path, scene, trajectory, tmp_path):
    other = tmp_path / "other.rrd"
    save_recording(other, scene, trajectory, TASK, "a title", "# A *summary*")
    result = subprocess.run(
        [RERUN, "rrd", "compare", path, other], capture_output=True, timeout=60
    )
    assert result.returncode == 0, result.stderr


def test_what_cannot_be_written_is_the_users_error(
    scene, trajectory, tmp_path, monkeypatch, caplog
):
    with pytest.raises(UserError, match="cannot write"):
        save_recording(tmp_path / "no" / "a.rrd", scene, trajectory, TASK, "", "")
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(UserError, match="RERUN"):
        save_recording(tmp_path / "a.rrd", scene, trajectory, TASK, "", "")
    assert list(tmp_path.iterdir()) == []


SHAPES = """
<mujoco>
  <asset>
    <material name="red" rgba="1 0 0 1"/>
    <texture name="flat" type="2d" builtin="flat" rgb1=".2 .4 1" width="8" height="8"/>
    <material name="tiles" rgba="1 1 0.5 1" texture="flat"/>
    <mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="0 0 1" material="tiles"/>
    <geom name="box" type="box" size="1 2 3" pos="4 0 3" zaxis="0 1 1"/>
    <geom name="ball" type="sphere" size="0.5" material="red"/>
    <geom name="egg" type="ellipsoid" size="0.5 1 2"/>
    <geom name="pill" type="capsule" size="0.5 1"/>
    <geom name="can" type="cylinder" size="0.5 1" group="3"/>
    <geom name="wedge" type="mesh" mesh="wedge"/>
    <geom name="ghost" type="sphere" size="1" rgba="1 1 1 0"/>
    <body name="bare"><geom name="hidden" size="1" group="3" mass="1"/></body>
  </worldbody>
</mujoco>
"""


def test_every_shape_is_drawn_unless_it_is_not_meant_to_be_seen(tmp_path):
    model = mujoco.MjModel.from_xml_string(SHAPES)
    seen = [model.geom(geom).name for geom in np.flatnonzero(drawn(model))]
    # a body that shows nothing else shows what it collides with
    assert seen == ["", "box", "ball", "egg", "pill", "wedge", "hidden"]
    np.testing.assert_array_equal(color(model, 2), [1, 0, 0, 1])
    mixed = color(model, 0)
    np.testing.assert_allclose(mixed, [0.2, 0.4, 0.5, 1], atol=1 / 255)
    kinds = [
        type(shapes._shape(model, geom)).__name__
        for geom in np.flatnonzero(drawn(model)).tolist()
    ]
    assert kinds == [
        "Boxes3D",
        "Boxes3D",
        "Ellipsoids3D",
        "Ellipsoids3D",
        "Capsules3D",
        "Mesh3D",
        "Ellipsoids3D",
    ]
    lower, upper = arena_box(model)
    half = (2 + 3) / np.sqrt(2)
    np.testing.assert_allclose([lower[0], upper[0]], [-1, 5], atol=1e-9)
    np.testing.assert_allclose([lower[1], upper[1]], [-half, half], atol=1e-9)


needs_opengl = pytest.mark.skipif(
    not (ctypes.util.find_library("EGL") or ctypes.util.find_library("OSMesa")),
    reason="no library of EGL or OSMesa to draw with",
)


@pytest.fixture
def champion(tmp_path):
    # half speed ahead
    genome = np.zeros(Network().n_genes)
    scene = {"robot": "epuck", "arena": "arena"}
    file = ControllerFile(Network(), genome, asdict(TaskParameters()), scene, {})
    path = tmp_path / "champion.json"
    path.write_text(file.to_json())
    return path


def render(*arguments, **environment):
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "epuck_mj.render", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=Path(__file__).parent.parent,
        env=os.environ | {"MUJOCO_GL": "disabled"} | environment,
    )


@needs_opengl
def test_picture_shows_arena_and_path(champion, tmp_path):
    output = tmp_path / "picture.png"
    size = ("--width", 300, "--height", 200)
    result = render(champion, "--output", output, *size, "--seconds", 5)
    assert result.returncode == 0, result.stderr
    assert re.fullmatch(r".*picture\.png: fitness .*\n", result.stdout)
    picture = imread(output)
    assert picture.shape[:2] == (200, 300)
    # the path's two colours, and everything between, are nowhere else so strong
    assert (np.ptp(picture[..., :3], axis=-1) > 0.5).sum() > 20


def test_bad_input_is_one_line_and_status_2(champion, tmp_path):
    other = json.loads(champion.read_text())
    other["task"] = {"speeds": {"warp": 9}}
    broken = tmp_path / "broken.json"
    broken.write_text(json.dumps(other))
    for arguments, message in [
        ((tmp_path / "none.json", "--output", "a.png"), "cannot read controller"),
        ((broken, "--output", "a.png"), "warp"),
        ((champion, "--output", "a.png", "--width", 0), "--width"),
        ((champion, "--output", "a.png", "--arena", "moon"), "no arena 'moon'"),
    ]:
        result = render(*arguments)
        assert result.returncode == 2
        assert re.fullmatch(r"error: [^\n]*\n", result.stderr), result.stderr
        assert message in result.stderr


def test_without_opengl_one_line_says_what_is_missing(monkeypatch):
    from epuck_mj import render

    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr(render, "find_library", lambda name: None)
    with pytest.raises(UserError, match="no OpenGL"), render.opengl(10, 10):
        pass
