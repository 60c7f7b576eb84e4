"""Recordings: the .rrd read back agrees with the trajectories."""

import itertools
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from epuck_mj.errors import UserError
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.geometry import drawn
from epuck_mj.scene.model import load_scene
from epuck_mj.show.colors import TRIALS
from epuck_mj.show.recording import Trial, save_recording
from epuck_mj.show.recording.entities import entities
from epuck_mj.show.recording.signals import SENSORS
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.phases import phases
from epuck_mj.trials.recorder import record
from tests.processes import PATIENCE

TASK = TaskParameters(steps=40)
START, BESIDE_A_WALL = np.array([[0.4, 0.1, 0.4], [0.35, -0.2, 0.2]])
RERUN = Path(sys.executable).with_name("rerun")
CRASHING, FOLLOWING = "/trials/straight_on", "/trials/test_1_left"


@pytest.fixture(scope="module", autouse=True)
def strict():
    """Errors of rerun raise, and nothing calls home."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {
            "CI": "1",
            "RERUN_STRICT": "1",
            "RUST_LOG": "error",
        }.items():
            patch.setenv(name, value)
        patch.delenv("RERUN", raising=False)
        yield


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
    """Has a crash and no network."""
    trajectory = record(scene, straight_on, START, TASK)
    assert trajectory.crashed
    return trajectory


@pytest.fixture(scope="module")
def network(scene):
    """Has a network and no crash."""
    genome = np.random.default_rng(11).uniform(-5, 5, Network().n_genes)
    task = replace(TASK, steps=25)
    trajectory = record(scene, Network().decode(genome), BESIDE_A_WALL, task)
    assert not trajectory.crashed
    assert np.ptp(trajectory.fitness) > 0
    return trajectory


@pytest.fixture(scope="module")
def path(scene, trajectory, tmp_path_factory):
    path = tmp_path_factory.mktemp("one") / "trial.rrd"
    trial = Trial("straight on", trajectory, TASK)
    save_recording(path, scene, [trial], "a title", "# A *summary*")
    return path


@pytest.fixture(scope="module")
def one(path):
    return Contents(path)


@pytest.fixture(scope="module")
def two(scene, trajectory, network, tmp_path_factory):
    """Trials of unequal length."""
    path = tmp_path_factory.mktemp("two") / "trials.rrd"
    trials = [
        Trial("straight on", trajectory, TASK),
        Trial("test 1: left", network, replace(TASK, steps=25)),
    ]
    save_recording(path, scene, trials, "two", "")
    return Contents(path)


class Contents:
    """What a recording holds."""

    def __init__(self, path):
        self.batches = {}
        for chunk in RrdReader(path).stream().to_chunks():
            key = chunk.entity_path, chunk.is_static
            self.batches.setdefault(key, []).append(chunk.to_record_batch())
        self.static = {entity for entity, static in self.batches if static}
        self.in_time = {entity for entity, static in self.batches if not static}

    def column(self, entity, component, static=False):
        """One component as nested lists, one per row."""
        return [
            row
            for batch in self.batches[entity, static]
            for name in batch.schema.names
            if name.endswith(component)
            for row in batch.column(name).to_pylist()
        ]

    def timeline(self, entity, name):
        (batch,) = self.batches[entity, False]
        return batch.column(name).cast("int64").to_numpy()


def verify(path):
    result = subprocess.run(
        [RERUN, "rrd", "verify", path], capture_output=True, text=True, timeout=PATIENCE
    )
    assert result.returncode == 0, result.stderr


def test_the_file_is_sound_and_alone(path):
    verify(path)
    assert list(path.parent.iterdir()) == [path]
    reader = RrdReader(path)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    assert reader.recordings()[0].application_id == "epuck_mj"


def rows_of(root, trajectory):
    """First row and number of rows of what changes, by entity."""
    steps = trajectory.steps
    sensed, decided, earned = (0, steps + 1), (0, steps), (1, steps)
    rows = {
        "robot/epuck": sensed,
        "robot/wheel_left": sensed,
        "robot/wheel_right": sensed,
        "path": earned,
        "rays": sensed,
        "signals/observation": sensed,
        "signals/proximity": sensed,
        "signals/action": decided,
        "signals/command": decided,
        "signals/clearance": sensed,
        "signals/step_fitness": earned,
        "signals/cumulative_fitness": earned,
    }
    if trajectory.crashed:
        rows["crash"] = (steps, 1)
    if trajectory.hidden.size:
        rows["signals/network"] = decided
    return {f"{root}/{name}": places for name, places in rows.items()}


def assert_rows(contents, expected):
    lanes = {f"/{'/'.join(entity.split('/')[1:3])}/phase" for entity in expected}
    assert contents.in_time == set(expected) | lanes
    for entity, (first, rows) in expected.items():
        step = contents.timeline(entity, "step")
        np.testing.assert_array_equal(step, np.arange(first, first + rows))
        # whole nanoseconds: floats would be cut off
        sim_time = contents.timeline(entity, "sim_time")
        np.testing.assert_array_equal(sim_time, step * 100_000_000)


def test_entities_rows_and_timelines(one, scene, trajectory):
    assert_rows(one, rows_of(CRASHING, trajectory))
    geoms = np.flatnonzero(drawn(scene.model))
    logged = [
        entity
        for entity in one.static
        if entity.startswith(("/arena/", f"{CRASHING}/robot/"))
    ]
    names = [scene.model.geom(geom).name or f"geom{geom}" for geom in geoms]
    assert sorted(entity.split("/")[-1] for entity in logged) == sorted(names)
    parts = {entity.rsplit("/", 1)[0] for entity in logged}
    bodies = ("epuck", "wheel_left", "wheel_right")
    assert parts == {"/arena"} | {f"{CRASHING}/robot/{body}" for body in bodies}
    summary = one.column("/summary", "TextDocument:text", static=True)
    assert summary == [["# A *summary*"]]
    name = one.column("/__properties", "RecordingInfo:name", static=True)
    assert name == [["a title"]]


def test_trials_of_unequal_length_share_a_file(two, trajectory, network):
    expected = rows_of(CRASHING, trajectory) | rows_of(FOLLOWING, network)
    assert len(expected) == 2 * 12 + 2
    assert_rows(two, expected)


@pytest.mark.parametrize("root", [CRASHING, FOLLOWING])
def test_marks_and_series_tell_trials_apart(one, two, root):
    name = {CRASHING: "straight on", FOLLOWING: "test 1: left"}[root]
    mark = f"{root}/robot/epuck/mark"
    label = f"{root}/robot/epuck/name"
    assert two.column(label, "Points3D:labels", static=True) == [[name]]
    red, green, blue = TRIALS[[CRASHING, FOLLOWING].index(root)]
    rgba = [red << 24 | green << 16 | blue << 8 | 255]
    assert two.column(mark, "Points3D:colors", static=True) == [rgba]
    for signal in ("clearance", "step_fitness", "cumulative_fitness"):
        entity = f"{root}/signals/{signal}"
        assert two.column(entity, "SeriesLines:names", static=True) == [[name]]
        assert two.column(entity, "SeriesLines:colors", static=True) == [rgba]
    # one needs neither
    ends = {entity.rpartition("/")[2] for entity in one.static}
    assert not ends & {"mark", "name"}


def test_equal_names_are_kept_apart(scene, network, tmp_path):
    names = ["a b", "a_b", "a b", "a b-2", "é", "?!"]
    roots = [place.root for place in entities(names)]
    assert len(set(roots)) == len(names)
    assert all(root.split("/")[1] for root in roots)
    path = tmp_path / "trials.rrd"
    trials = [Trial(name, network, TASK) for name in names]
    save_recording(path, scene, trials, "", "")
    contents = Contents(path)
    logged = {"/".join(e.split("/")[1:3]) for e in contents.in_time}
    assert logged == set(roots)
    labels = [
        contents.column(f"/{root}/robot/epuck/name", "Points3D:labels", static=True)
        for root in roots
    ]
    assert labels == [[[name]] for name in names]


@pytest.mark.parametrize("root", [CRASHING, FOLLOWING])
def test_signals_hold_the_trajectory(two, scene, trajectory, network, root):
    shown = {CRASHING: trajectory, FOLLOWING: network}[root]
    clearance = ClearanceProbe(scene, 1).measure(shown.pose).distance
    v, w = shown.action.T
    # what the output neurons say, from 0 to 1, before it is an action
    output = np.stack([v, (w + 1) / 2], axis=1)
    hidden = [f"h{i}" for i in range(shown.hidden.shape[1])]
    expected = {
        "observation": (shown.observation, SENSORS),
        "proximity": (shown.proximity, SENSORS),
        "action": (shown.action, ["v", "w"]),
        "command": (shown.command, ["left", "right"]),
        "clearance": (1000 * clearance[:, None], None),
        "step_fitness": (shown.fitness[:, None], None),
        "cumulative_fitness": (np.cumsum(shown.fitness)[:, None], None),
    }
    if root == FOLLOWING:
        assert len(hidden) == 4
        network_values = np.concatenate([shown.hidden, output], axis=1)
        expected["network"] = network_values, [*hidden, "v", "w"]
    for signal, (values, names) in expected.items():
        entity = f"{root}/signals/{signal}"
        rows = two.column(entity, "Scalars:scalars")
        np.testing.assert_allclose(rows, values, rtol=1e-15, atol=0)
        if names is not None:
            (styled,) = two.column(entity, "SeriesLines:names", static=True)
            assert styled == list(names)
    logged = {
        entity.rsplit("/", 1)[1]
        for entity in two.in_time
        if entity.startswith(f"{root}/signals/")
    }
    assert logged == set(expected)


def test_the_lane_holds_the_phases(scene, tmp_path):
    trajectory = record(
        scene, WallFollower(), np.array([0.3, 0.2, 0.5]), TaskParameters(steps=120)
    )
    path = tmp_path / "trial.rrd"
    trial = Trial("follower", trajectory, TaskParameters())
    save_recording(path, scene, [trial], "", "")
    clearance = ClearanceProbe(scene, 1).measure(trajectory.pose).distance
    expected = phases(trajectory, clearance)
    assert len(set(expected)) == 3
    contents, lane = Contents(path), "/trials/follower/phase"
    begins, states = contents.timeline(lane, "step"), contents.column(lane, "state")
    assert begins[0] == 0
    # each row has the state that began last
    shown = np.array(states)[np.searchsorted(begins, np.arange(121), "right") - 1, 0]
    np.testing.assert_array_equal(shown, expected)
    # nothing begins twice
    assert all(a != b for a, b in itertools.pairwise(states))
    (values,) = contents.column(lane, "StateConfiguration:values", static=True)
    assert values == ["searching", "following", "cornering", "crashed"]


def test_the_lane_ends_with_the_crash(one, trajectory):
    lane = f"{CRASHING}/phase"
    assert one.column(lane, "state")[-1] == ["crashed"]
    assert one.timeline(lane, "step")[-1] == trajectory.steps


def test_robot_path_and_crash_are_where_the_robot_was(one, trajectory):
    body = f"{CRASHING}/robot/epuck"
    position = np.array(one.column(body, "Transform3D:translation"))[:, 0]
    np.testing.assert_allclose(position[:, :2], trajectory.pose[:, :2], atol=1e-6)
    x, y, z, w = np.array(one.column(body, "Transform3D:quaternion"))[:, 0].T
    np.testing.assert_allclose(x**2 + y**2, 0, atol=1e-6)
    yaw = 2 * np.arctan2(z, w)
    np.testing.assert_allclose(np.sin(yaw - trajectory.pose[:, 2]), 0, atol=1e-6)
    strips = np.array(one.column(f"{CRASHING}/path", "LineStrips3D:strips"))[:, 0]
    np.testing.assert_allclose(strips[:, 0, :2], trajectory.pose[:-1, :2], atol=1e-6)
    np.testing.assert_allclose(strips[:, 1, :2], trajectory.pose[1:, :2], atol=1e-6)
    crash = np.array(one.column(f"{CRASHING}/crash", "Points3D:positions"))
    np.testing.assert_allclose(crash[0, 0, :2], trajectory.pose[-1, :2], atol=1e-6)


def test_rays_are_as_long_as_what_they_measured(one, trajectory):
    rays = np.array(one.column(f"{CRASHING}/rays", "LineStrips3D:strips"))
    length = np.linalg.norm(rays[:, :, 1] - rays[:, :, 0], axis=-1)
    np.testing.assert_allclose(
        length, trajectory.observation * TASK.sensor_range, atol=1e-6
    )
    # they leave the robot: every end is farther from its axis than its origin
    radius = np.linalg.norm(rays[..., :2] - trajectory.pose[:, None, None, :2], axis=-1)
    assert (radius[:, :, 1] >= radius[:, :, 0] - 1e-6).all()


@pytest.mark.parametrize(("trials", "limit"), [(1, 1_000_000), (4, 4_000_000)])
def test_recordings_of_whole_trials_are_small(scene, tmp_path, trials, limit):
    task = TaskParameters()
    genomes = np.random.default_rng(0).uniform(-5, 5, (50, Network().n_genes))
    lived = []
    for controller in map(Network().decode, genomes):
        trajectory = record(scene, controller, np.zeros(3), task)
        lived += [trajectory] if trajectory.steps == task.steps == 300 else []
        if len(lived) == trials:
            break
    path = tmp_path / "trials.rrd"
    named = [Trial(f"trial {i}", each, task) for i, each in enumerate(lived)]
    assert len(named) == trials
    save_recording(path, scene, named, "", "")
    assert 100_000 < path.stat().st_size < limit
    verify(path)


def test_two_files_of_a_trial_say_the_same(path, scene, trajectory, tmp_path):
    other = tmp_path / "other.rrd"
    trial = Trial("straight on", trajectory, TASK)
    save_recording(other, scene, [trial], "a title", "# A *summary*")
    result = subprocess.run(
        [RERUN, "rrd", "compare", path, other], capture_output=True, timeout=PATIENCE
    )
    assert result.returncode == 0, result.stderr
    identity = [RrdReader(each).recordings()[0].recording_id for each in (path, other)]
    assert identity[0] == identity[1]
    trial = Trial(
        "straight on", replace(trajectory, fitness=trajectory.fitness / 2), TASK
    )
    save_recording(other, scene, [trial], "a title", "# A *summary*")
    assert RrdReader(other).recordings()[0].recording_id != identity[0]


def test_saving_needs_no_opengl_and_says_nothing(tmp_path):
    code = """
import sys
import numpy as np
from epuck_mj.step.control import TaskParameters
from epuck_mj.scene.model import load_scene
from epuck_mj.show.recording import Trial, save_recording
from epuck_mj.trials.recorder import record
from epuck_mj.policies.wall_follower import WallFollower

scene, task = load_scene("epuck", "arena"), TaskParameters(steps=5)
trial = Trial("a", record(scene, WallFollower(), np.zeros(3), task), task)
save_recording(sys.argv[1], scene, [trial, trial], "", "")
drawing = {"OpenGL", "glfw", "imageio_ffmpeg", "matplotlib", "mujoco.renderer"}
assert not drawing & set(sys.modules), drawing & set(sys.modules)
"""
    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    environment |= {"MUJOCO_GL": "disabled"}
    path = tmp_path / "trial.rrd"
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, path],
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert path.stat().st_size > 10_000


def test_what_cannot_be_written_is_the_users_error(
    scene, trajectory, tmp_path, monkeypatch
):
    trials = [Trial("a", trajectory, TASK)]
    with pytest.raises(UserError, match="cannot write"):
        save_recording(tmp_path / "no" / "a.rrd", scene, trials, "", "")
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(UserError, match="RERUN"):
        save_recording(tmp_path / "a.rrd", scene, trials, "", "")
    assert list(tmp_path.iterdir()) == []
