"""`evolution.evaluate`: champions tested again, by anybody."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.host.files import read_arrays
from epuck_mj.policies.file import load_controller
from epuck_mj.scene.model_files import MODELS
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.calibration import Calibration
from evolution.evaluate import evaluate_policies
from evolution.judging.held_out import Judge, Judges
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from tests.no_pictures import draw_nothing


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    """A study directory of a single, tiny run, without the pictures."""
    fields = load_config(find_config("ga")).model_dump()
    fields |= {"evaluations": 20, "steps": 20, "trials": 2}
    fields |= {"validation_starts": 10, "test_starts": 30}
    fields["optimizer"]["population"] = 10
    path = tmp_path_factory.mktemp("study") / "ga" / "seed-1"
    run = Run(ExperimentConfig.parsed(fields, "ga"), RunDirectory(path), Means(), ())
    run.start()
    assert len(list(run.evolve())) == 2
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        run.finish()
    return path


def test_evaluation_says_what_the_run_said(finished, tmp_path, capsys):
    out = tmp_path / "out.json"
    assert evaluate_policies([str(finished), "--starts", "30", "--json", str(out)]) == 0
    written = load_controller(finished / "champion.json").scores["held_out"]
    tests = json.loads(out.read_text())
    assert (
        [test["robot"] for test in tests]
        == list(written)
        == ["epuck", "epuck_kinematic"]
    )
    for test in tests:
        assert test.items() >= written[test["robot"]].items()
    text = capsys.readouterr().out
    assert f"mean {tests[0]['mean']:.1f}" in text
    assert "30 starts" in text


def test_a_study_a_run_and_a_file_lead_to_the_same_champion(finished, capsys):
    study = finished.parent.parent
    for path in (study, finished, finished / "champion.json"):
        assert (
            evaluate_policies(
                [str(path), "--starts", "5", "--robot", "epuck_kinematic"]
            )
            == 0
        )
    blocks = capsys.readouterr().out.split("epuck_kinematic in arena\n")
    outcomes = [re.sub(r"\n\S.*", "", block, flags=re.S) for block in blocks[1:]]
    assert len(outcomes) == 3
    assert len({outcome.strip() for outcome in outcomes}) == 1


def test_generations_are_tested_one_by_one(finished, tmp_path, capsys):
    out = tmp_path / "out.json"
    few = ["--starts", "20", "--robot", "epuck_kinematic", "--json", str(out)]
    assert evaluate_policies([str(finished), "--generations", "0,last", *few]) == 0
    tests = json.loads(out.read_text())
    names = [f"{finished} generation 0", f"{finished} generation 1"]
    assert [test["name"] for test in tests] == names
    said = capsys.readouterr().out
    assert all(f"{name}, epuck_kinematic in arena\n" in said for name in names)
    # each is what anybody finds for its genome
    config = load_config(finished / "config.yaml")
    judge = Judges().of("epuck_kinematic", config.setting)
    genomes = read_arrays(finished / "best_individuals.npz")["genomes"]
    for genome, test in zip(genomes, tests, strict=True):
        assert judge.test(config.topology.decode(genome), 20).mean == test["mean"]


def test_the_hand_written_follower_follows(capsys):
    arguments = ["wall-follower", "--starts", "10", "--robot", "epuck_kinematic"]
    assert evaluate_policies(arguments) == 0
    assert "behaviour: wall follower 100.0%" in capsys.readouterr().out


def test_another_arena(finished, tmp_path, capsys):
    arena = tmp_path / "small.xml"
    walls = "".join(
        f'<geom type="box" pos="{x} {y} 0.05" size="{a} {b} 0.05"/>'
        for x, y, a, b in [
            (0.3, 0, 0.01, 0.3),
            (-0.3, 0, 0.01, 0.3),
            (0, 0.3, 0.3, 0.01),
            (0, -0.3, 0.3, 0.01),
        ]
    )
    floor = '<geom type="plane" size="1 1 0.1"/>'
    arena.write_text(f"<mujoco><worldbody>{floor}{walls}</worldbody></mujoco>")
    arguments = ["--starts", "5", "--arena", str(arena), "--robot", "epuck_kinematic"]
    assert evaluate_policies([str(finished), *arguments]) == 0
    assert "epuck_kinematic in small.xml" in capsys.readouterr().out


def test_where_a_wall_has_no_outline_wheels_are_enough(tmp_path, capsys):
    arena = tmp_path / "leaning.xml"
    leaning = '<geom name="mast" type="cylinder" size=".02 .1" euler="20 0 0"/>'
    arena.write_text(
        (MODELS / "arena.xml")
        .read_text()
        .replace("</worldbody>", f"{leaning}</worldbody>")
    )
    few = ["wall-follower", "--starts", "5", "--arena", str(arena)]
    assert evaluate_policies(few) == 0
    out, err = capsys.readouterr()
    assert "epuck in leaning.xml" in out
    assert "epuck_kinematic" not in out
    assert err.startswith("wall-follower: not tested on epuck_kinematic: arena '")
    assert "geom 'mast' has no exact outline" in err
    assert err.count("\n") == 1
    with pytest.raises(UserError, match=r"'mast' has no .*--robot epuck simulates it$"):
        evaluate_policies([*few, "--robot", "epuck_kinematic"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "expected run or study directories"),
        (["nowhere"], "no champion in 'nowhere'"),
        (
            ["wall-follower", "--starts", "1"],
            "from 2 to 100,000, got 1",
        ),
        (["wall-follower", "--robot", "r2d2"], "r2d2"),
        (["wall-follower", "--generations", "0"], "saved its generations"),
        (["."], "no champion in '.'"),
    ],
)
def test_bad_input_gets_one_line(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=re.escape(message)) as error:
        evaluate_policies(arguments)
    assert "\n" not in str(error.value)


def test_threads_change_nothing(scene):
    from epuck_mj.policies.wall_follower import WallFollower
    from epuck_mj.step.control import TaskParameters

    space, task = FreeSpace(scene, 0.01), TaskParameters(steps=20)
    tests = [
        Judge(scene, space, task, threads).test(WallFollower(), 100)
        for threads in (1, 2)
    ]
    assert tests[0] == tests[1]
    assert tests[0].starts == 100
    assert sum(tests[0].behaviour.values()) == pytest.approx(1)
    low, high = tests[0].interval
    assert tests[0].worst < low < tests[0].mean < high


def test_the_best_stored_is_tested_too(finished):
    scores = load_controller(finished / "champion.json").scores
    history = np.genfromtxt(finished / "history.csv", delimiter=",", names=True)
    assert scores["best_stored"]["fitness"] == history["best"].max()
    assert 0 <= scores["best_stored"]["held_out"] <= 20


def test_a_robot_that_was_measured(tmp_path):
    path, out = tmp_path / "robot.yaml", tmp_path / "out.json"
    calibration = Calibration((0.7,) * 4 + (1.3,) * 4, (0.02, 0.0204), 0.055)
    calibration.save(path)
    own = ["--calibration", str(path)]
    options = ["wall-follower", "--starts", "5", "--noise", "calibrated"]
    means = []
    for more in ([], ["--randomise"], own):
        assert evaluate_policies([*options, *more, "--json", str(out)]) == 0
        means.append(tuple(test["mean"] for test in json.loads(out.read_text())))
    assert len(set(means)) == 3
    assert json.loads(out.read_text())[0]["calibration"] == {
        "proximity_gains": list(calibration.proximity_gains),
        "wheel_radii": list(calibration.wheel_radii),
        "track": calibration.track,
        "latency": 0,
        "lag": 1.0,
    }
    for wrong, message in {
        ("wall-follower", *own): "calibration needs noise: calibrated or strong, got",
        (*options, *own, "--randomise"): "expected randomise or calibration, got both",
        (*options, "--json", str(tmp_path)): "--json: expected a name that ends in .j",
        (*options, "--json", "run/history.csv"): "ends in .json, got 'run/history.csv'",
        (*options, "--json", "no/out.json"): "cannot write .*no folder 'no'",
        (*options, "--calibration", "no.yaml"): "cannot read 'no.yaml'",
    }.items():
        with pytest.raises(UserError, match=message):
            evaluate_policies(list(wrong))
