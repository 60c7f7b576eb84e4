"""`evolution.replay`: what it shows of whom, and what it says to what it cannot."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, Origin, load_controller
from epuck_mj.policies.network import Network
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record, record_trajectories
from epuck_mj.trials.trajectory import Trajectory
from evolution.judging.held_out_starts import (
    held_out_disturbances,
    starts_for_test,
    starts_for_validation,
)
from evolution.replay import output, viewer
from evolution.replay.__main__ import replay
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.settings.randomness import Purpose

STEPS = 8
SAVED = re.compile(r"(?P<path>\S+\.rrd); watch it: \S+ -m rerun (?P=path)")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working directory on a machine without a display."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "RERUN"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def write_champion(path, seed=0, arena="arena", **task):
    genome = np.random.default_rng(seed).uniform(-5, 5, Network().n_genes)
    parameters = replace(TaskParameters(steps=STEPS), **task)
    origin = Origin("epuck_kinematic", arena)
    file = ControllerFile(Network(), genome, parameters, origin, {"stored": 12.34})
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(file.to_json())
    return str(path)


@pytest.fixture
def champion(here):
    return write_champion(here / "run" / "champion.json")


@pytest.fixture
def run(here):
    """An unfinished run of five generations, as far as replay looks at it."""
    fields = load_config(find_config("de-best")).model_dump() | {"steps": STEPS}
    config = ExperimentConfig.parsed(fields, "test")
    directory = here / "runs" / "de-best-seed-1"
    directory.mkdir(parents=True)
    (directory / "config.yaml").write_text(config.to_yaml())
    genomes = np.random.default_rng(1).uniform(-5, 5, (5, Network().n_genes))
    best = {"genomes": genomes, "fitness": np.arange(5.0)}
    files.write_arrays(directory / "best_individuals.npz", best)
    return directory


class Recording:
    """Trials of a recording by the names of their entities."""

    def __init__(self, path):
        self.poses, self.crashed, self.summary, self.title = {}, set(), "", ""
        self.arena = set()
        for chunk in RrdReader(path).stream().to_chunks():
            batch = chunk.to_record_batch()
            parts = chunk.entity_path.split("/")
            columns = {name: batch.column(name) for name in batch.schema.names}
            if parts[1] == "summary":
                self.summary = columns["TextDocument:text"].to_pylist()[0][0]
            elif parts[1] == "__properties" and "RecordingInfo:name" in columns:
                self.title = columns["RecordingInfo:name"].to_pylist()[0][0]
            elif parts[1] == "arena":
                self.arena.add(parts[2])
            elif parts[3:] == ["robot", "epuck"] and not chunk.is_static:
                rows = columns["Transform3D:translation"].to_pylist()
                self.poses[parts[2]] = np.array(rows)[:, 0, :2]
            elif parts[3:] == ["crash"]:
                self.crashed.add(parts[2])

    @property
    def starts(self):
        return {name: poses[0] for name, poses in self.poses.items()}


def shown(*argv, path="out.rrd"):
    assert replay([*argv, "--save", path]) == 0
    return Recording(path)


def starts(n, which=starts_for_test):
    space = FreeSpace(load_scene("epuck", "arena"), 0.01)
    return which(space)[:n, :2]


def test_noise_is_shown_on_demand(champion):
    ideal, noisy = shown(champion), shown(champion, "--noise", "strong")
    (before,), (after,) = ideal.poses.values(), noisy.poses.values()
    assert before.shape != after.shape or (before != after).any()
    assert "noise strong" in noisy.summary
    assert "noise" not in ideal.summary.split("##")[0]
    others = shown(champion, "--noise", "strong", "--randomise")
    assert "noise strong, other robots" in others.summary
    # what is met depends on the start alone: seen again, it is the same
    again = shown(champion, "--noise", "strong")
    np.testing.assert_array_equal(next(iter(again.poses.values())), after)


def test_a_champion_is_shown_as_it_evolved_unless_asked_otherwise(champion, here):
    fields = load_config(find_config("ga-randomised")).model_dump() | {"steps": STEPS}
    text = ExperimentConfig.parsed(fields, "test").to_yaml()
    (here / "run" / "config.yaml").write_text(text)
    first = ("--starts", "test:0")
    evolved = shown(champion, *first)
    assert "noise calibrated, other robots" in evolved.summary
    asked = shown(champion, "--noise", "calibrated", "--randomise", *first)
    for name, poses in evolved.poses.items():
        np.testing.assert_array_equal(poses, asked.poses[name])
    ideal = shown(champion, "--noise", "none")
    assert "noise" not in ideal.summary.split("##")[0]
    # the trial is that of the held-out test of all starts
    config = ExperimentConfig.parsed(fields, "test")
    met = held_out_disturbances(config.conditions, Purpose.TEST, 1000, STEPS)
    assert met is not None
    scene = load_scene("epuck", "arena", config.control_step)
    start = starts_for_test(FreeSpace(scene, 0.01), 1)[0]
    policy = load_controller(Path(champion)).controller
    trial = record(scene, policy, start, TaskParameters(steps=STEPS), met[:1])
    np.testing.assert_allclose(
        next(iter(evolved.poses.values())), trial.pose[:, :2], atol=1e-6
    )


@pytest.mark.parametrize(
    "flags", [("--randomise",), ("--noise", "none", "--randomise")]
)
def test_other_robots_need_noise(champion, flags):
    with pytest.raises(UserError, match="randomise needs noise"):
        replay([champion, *flags])


def test_without_a_display_the_recording_is_beside_the_champion(
    champion, here, capfd, monkeypatch
):
    monkeypatch.setattr(output, "open_viewer", None)
    assert replay([champion]) == 0
    out, err = capfd.readouterr()
    outcome, line = out.splitlines()
    said = r"run/champion\.json: fitness \d\.\d of 8 \(start test:15, .*"
    assert re.fullmatch(said, outcome)
    path = here / "run" / "replay.rrd"
    assert re.fullmatch(
        rf"{path}; there is no display here; watch it: \S+ -m rerun {path}", line
    )
    assert err == ""
    recording = Recording(path)
    assert list(recording.poses) == ["run_champion_json"]
    assert recording.title == "run/champion.json"
    assert "run/champion.json: fitness" in recording.summary
    assert "from its trials in evolution: 12.3" in recording.summary


def test_the_trial_is_the_one_that_anybody_can_repeat(champion, here, capsys):
    recording = shown(champion, "--starts", "test:0")
    policy, task = load_controller(champion).controller, TaskParameters(steps=STEPS)
    start = starts_for_test(FreeSpace(load_scene("epuck", "arena"), 0.01), 1)[0]
    trajectory = record(load_scene("epuck", "arena"), policy, start, task)
    (poses,) = recording.poses.values()
    np.testing.assert_allclose(poses, trajectory.pose[:, :2], atol=1e-6)
    said = f"fitness {trajectory.trial_fitness:.1f} of 8"
    assert said in capsys.readouterr().out


def test_the_trial_of_median_fitness_is_shown_first(champion, here, capsys):
    (poses,) = shown(champion).poses.values()
    out = capsys.readouterr().out
    scene, task = load_scene("epuck", "arena"), TaskParameters(steps=STEPS)
    starts = starts_for_test(FreeSpace(scene, 0.01), 25)
    policy = load_controller(champion).controller
    trials = record_trajectories(scene, policy, starts, task)
    order = np.argsort([trial.trial_fitness for trial in trials], kind="stable")
    typical = trials[order[12]]
    np.testing.assert_allclose(poses, typical.pose[:, :2], atol=1e-6)
    where = f"(start test:{order[12]}, median fitness of the first 25)"
    assert where in out


def test_a_run_directory_and_its_file_are_the_same_champion(champion, here):
    poses = [shown(path).poses for path in (champion, "run", "run/")]
    arrays = [next(iter(each.values())) for each in poses]
    np.testing.assert_array_equal(arrays[0], arrays[1])
    np.testing.assert_array_equal(arrays[0], arrays[2])


def test_save_makes_the_folder_and_says_how_to_watch(champion, here, capsys):
    recording = shown(champion, path="new/folder/a.rrd")
    assert recording.poses
    line = capsys.readouterr().out.splitlines()[-1]
    assert SAVED.fullmatch(line)
    assert line.startswith("new/folder/a.rrd; ")
    # and nothing was put beside the champion
    assert [path.name for path in (here / "run").iterdir()] == ["champion.json"]


def test_trials_are_the_first_test_starts(champion):
    found = shown(champion, "--trials", "3").starts
    assert list(found) == ["test_0", "test_1", "test_2"]
    np.testing.assert_allclose(list(found.values()), starts(3), atol=1e-6)


@pytest.mark.parametrize(
    ("spec", "names"),
    [
        ("test:0", ["run_champion_json"]),
        ("test:3-5", ["test_3", "test_4", "test_5"]),
        ("validation:7-8", ["validation_7", "validation_8"]),
        ("validation:199-199", ["run_champion_json"]),
    ],
)
def test_starts_by_name(champion, spec, names):
    found = shown(champion, "--starts", spec).starts
    assert list(found) == names
    which, first = spec.split(":")
    draw = starts_for_test if which == "test" else starts_for_validation
    first = int(first.split("-")[0])
    expected = starts(200, draw)[first : first + len(names)]
    np.testing.assert_allclose(list(found.values()), expected, atol=1e-6)


@pytest.mark.parametrize(
    "pose", [("0", "0", "0"), ("-0.25", "-.1", "-90"), ("0.1", "-1e-1", "1e3")]
)
def test_a_pose(champion, pose):
    recording = shown(champion, "--pose", *pose)
    (poses,) = recording.poses.values()
    np.testing.assert_allclose(poses[0], np.array(pose[:2], float), atol=1e-6)
    scene, task = load_scene("epuck", "arena"), TaskParameters(steps=STEPS)
    x, y, degrees = map(float, pose)
    start = np.array([x, y, np.radians(degrees)])
    trajectory = record(scene, load_controller(champion).controller, start, task)
    np.testing.assert_allclose(poses, trajectory.pose[:, :2], atol=1e-6)


def test_compared_are_several_on_the_same_start(champion, here):
    other = write_champion(here / "other" / "champion.json", 1)
    recording = shown(champion, "--compare", other, "wall-follower")
    assert list(recording.poses) == [
        "run_champion_json",
        "other_champion_json",
        "wall_follower",
    ]
    first, *others = recording.starts.values()
    for start in others:
        np.testing.assert_array_equal(start, first)
    assert recording.title == "run/champion.json, other/champion.json, wall-follower"
    # on several starts each has its own trial
    recording = shown(champion, "--compare", other, "--trials", "2")
    assert len(recording.poses) == 4
    assert "other_champion_json_test_1" in recording.poses


def test_generations_of_an_unfinished_run(run, capsys):
    recording = shown(str(run), "--generations", "0,3,last")
    assert list(recording.poses) == ["generation_0", "generation_3", "generation_4"]
    outcomes = capsys.readouterr().out.splitlines()[:3]
    assert [line.split(":")[0] for line in outcomes] == [
        "generation 0",
        "generation 3",
        "generation 4",
    ]
    assert "from its trials in evolution: 3.0" in recording.summary


@pytest.mark.parametrize("option", [(), ("--generations", "last")])
def test_what_is_replayed_of_a_run_lies_beside_it(run, option, here, capsys):
    if not option:
        write_champion(run / "champion.json")
    assert replay([str(run), *option]) == 0
    assert (run / "replay.rrd").stat().st_size > 10_000
    # the working directory is left alone
    assert [path.name for path in here.iterdir()] == ["runs"]


def test_arena_and_robot_can_be_others(champion, here):
    walls = shown(champion).arena
    (poses,) = shown(champion, "--arena", "pillars").poses.values()
    assert shown(champion, "--arena", "pillars").arena - walls
    other = write_champion(here / "o" / "champion.json", 0, arena="pillars")
    (alike,) = shown(other).poses.values()
    np.testing.assert_array_equal(alike, poses)
    (cheap,) = shown(champion, "--robot", "epuck_kinematic").poses.values()
    (wheeled,) = shown(champion, "--robot", "epuck").poses.values()
    assert cheap.shape == wheeled.shape
    assert (cheap != wheeled).any()


def ahead(observation):
    """Full speed straight on."""
    return np.broadcast_to([1.0, 0.0], (*observation.shape[:-1], 2)).copy()


def test_a_recorded_trajectory(here, champion, capsys):
    scene = load_scene("epuck", "arena")
    trajectory = record(
        scene, ahead, np.array([0.3, 0.0, 0.0]), TaskParameters(steps=40)
    )
    trajectory.save("crash of-today.npz")
    recording = shown("crash of-today.npz")
    assert list(recording.poses) == ["crash_of_today"]
    assert recording.crashed == {"crash_of_today"}
    (poses,) = recording.poses.values()
    np.testing.assert_allclose(poses, trajectory.pose[:, :2], atol=1e-6)
    seconds = f"{trajectory.time[-1]:.1f}"
    assert f"crash after {seconds} s" in capsys.readouterr().out
    # beside simulated ones
    recording = shown(champion, "--compare", "crash of-today.npz")
    assert sorted(recording.poses) == ["crash_of_today", "run_champion_json"]


def test_a_robots_own_trajectory_needs_no_simulation(here):
    """Unevenly spaced, as a real one is, and of a robot that saw nothing."""
    scene = load_scene("epuck", "arena")
    trajectory = record(scene, ahead, np.zeros(3), TaskParameters(steps=5))
    time = trajectory.time + np.array([0, 0.01, -0.02, 0.03, 0, 0.2])
    replace(trajectory, time=time).save("robot.npz")
    assert Trajectory.load("robot.npz").steps == 5
    assert list(shown("robot.npz").poses) == ["robot"]
    for option in (
        ["--trials", "2"],
        ["--pose", "0", "0", "0"],
        ["--generations", "0"],
    ):
        assert "expected a policy with --trials" in refused("robot.npz", *option)


def test_a_viewer_opens_where_there_is_a_display(champion, here, monkeypatch, capsys):
    opened = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(output, "open_viewer", opened.append)
    assert replay([champion]) == 0
    path = here / "run" / "replay.rrd"
    assert opened == [path]
    assert capsys.readouterr().out.splitlines()[-1] == f"{path}, shown in the viewer"
    # not for those who want a file
    shown(champion)
    assert opened == [path]


@pytest.mark.parametrize("reason", ["gone", "cannot start"])
def test_a_viewer_that_is_not_there_loses_nothing(
    reason, champion, here, monkeypatch, capsys
):
    binary = here / "no" / "rerun" if reason == "gone" else Path(champion)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(viewer, "viewer_binary", lambda: binary)
    assert replay([champion]) == 0
    path = here / "run" / "replay.rrd"
    line = capsys.readouterr().out.splitlines()[-1]
    assert line.startswith(f"{path}; the viewer did not open (")
    assert line.endswith(f"-m rerun {path}")
    assert Recording(path).poses


def refused(*argv):
    with pytest.raises(UserError) as error:
        replay(argv)
    assert "\n" not in str(error.value)
    return str(error.value)


REFUSED = [
    (["--pose", "0", "0"], "expected --pose with x [m], y [m] and heading"),
    (["--pose", "nan", "0", "0"], "got nan 0 0"),
    (["--pose", "0", "0", "inf"], "got 0 0 inf"),
    (["--pose", "5", "0", "0"], "expected --pose in the arena, x from -0.5"),
    (["--pose", "0", "-1e11", "0"], "got 0 -1e+11"),
    (["--pose", "0.49", "0", "0"], "touches nothing, got pose 0.49 0 0 in"),
    (["--trials", "0"], "expected at least 1 trial, got 0"),
    (["--trials", "51"], "expected at most 50 trials, got 1 policies on 51"),
    (["--trials", "1001"], "expected test starts from 0 to 999"),
    (["--trials", "many"], "--trials"),
    (["--trials", "2", "--pose", "0", "0", "0"], "expected one of --trials, "),
    (["--trials", "1", "--starts", "test:0"], "expected one of --trials, "),
    (["--starts", "test"], "expected starts such as test:0, test:0-9"),
    (["--starts", "train:0"], "got 'train:0'"),
    (["--starts", "test:-1"], "got 'test:-1'"),
    (["--starts", "test:" + "9" * 5000], "expected starts such as"),
    (["--starts", "test:5-2"], "the lower number first, got 'test:5-2'"),
    (["--starts", "test:990-1000"], "expected test starts from 0 to 999"),
    (["--starts", "validation:200"], "expected validation starts from 0 to 199"),
    (["--generations", "0"], "expected a run that has saved its generations"),
    (["--robot", "r2d2"], "no robot 'r2d2'"),
    (["--arena", "moon"], "no arena 'moon'"),
    (["--compare", "nowhere"], "no champion in 'nowhere'"),
    (["--compare", "elsewhere.npz"], "cannot read 'elsewhere.npz'"),
    (["--compare", "pillars.json"], "evolved in different arenas (arena, pillars)"),
    (["--compare", "slow.json"], "the same control step, got [0.1, 0.2]"),
    (["--compare", "old.npz"], "cannot read 'old.npz': expected an .npz archive"),
    (["more"], "more"),
    (["--color", "red"], "--color"),
    (["--save", "/proc/nobody/a.rrd"], "cannot write '/proc/nobody'"),
    (["--save", "."], "--save: expected a name that ends in .rrd, got '.'"),
    (["--save", "run/config.yaml"], "--save: expected a name that ends in .rrd, got"),
    (["--image", "run/history.csv"], "--image: expected a name that ends in .png"),
    (["--video", "run/champion.json"], "--video: expected a name that ends in .mp4"),
    (["--save", "run/champion.json/a.rrd"], "cannot write 'run/champion.json'"),
    (["--image", "run/champion.json/a.png"], "cannot write 'run/champion.json'"),
    (["--web", "run/champion.json"], "cannot write 'run/champion.json'"),
]


@pytest.mark.parametrize(
    ("arguments", "message"), REFUSED, ids=[" ".join(each[0])[:40] for each in REFUSED]
)
def test_bad_input_is_one_line(arguments, message, champion, here):
    write_champion(here / "pillars.json", arena="pillars")
    write_champion(here / "slow.json", control_step=0.2)
    (here / "old.npz").write_bytes(b"PK" + b"\0" * 50)
    before = sorted(here.rglob("*"))
    assert message in refused(champion, *arguments)
    assert sorted(here.rglob("*")) == before


@pytest.mark.parametrize("path", ["nowhere", ".", "a" * 300, "x.npz", "\0"], ids=repr)
def test_what_cannot_be_replayed_is_one_line(path, here):
    message = refused(path)
    assert "no champion in" in message or "cannot read 'x.npz'" in message


def test_nothing_to_replay_is_one_line(here):
    assert refused().startswith("expected what to replay: a run directory")


def test_help_says_what_each_option_is_for(capsys):
    with pytest.raises(SystemExit) as end:
        replay(["--help"])
    assert not end.value.code
    text = capsys.readouterr().out
    for option in ("compare", "generations", "starts", "pose", "save", "web", "video"):
        assert f"--{option}" in text
