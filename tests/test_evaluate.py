"""`evolution.evaluate` and `evolution.verify`: champions tested again, by anybody."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.host.files import read_arrays
from epuck_mj.policies.file import load_controller
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.calibration import Calibration
from evolution.evaluate import evaluate_policies
from evolution.judging.held_out import Judge, Judges
from evolution.run import results
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.verify import verify


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
        patch.setattr(results, "_draw_fitness", lambda *_: None)
        patch.setattr(results, "_show", lambda *_: None)
        run.finish()
    return path


def test_evaluation_says_what_the_run_said(finished, tmp_path, capsys):
    out = tmp_path / "out.json"
    assert evaluate_policies([str(finished), "--starts", "30", "--json", str(out)]) == 0
    written = load_controller(finished / "champion.json").scores["held_out"]
    tests = json.loads(out.read_text())
    assert (
        [test["robot"] for test in tests] == list(written) == ["epuck_planar", "epuck"]
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
            evaluate_policies([str(path), "--starts", "5", "--robot", "epuck_planar"])
            == 0
        )
    blocks = capsys.readouterr().out.split("epuck_planar in arena\n")
    outcomes = [re.sub(r"\n\S.*", "", block, flags=re.S) for block in blocks[1:]]
    assert len(outcomes) == 3
    assert len({outcome.strip() for outcome in outcomes}) == 1


def test_generations_are_tested_one_by_one(finished, tmp_path, capsys):
    out = tmp_path / "out.json"
    few = ["--starts", "20", "--robot", "epuck_planar", "--json", str(out)]
    assert evaluate_policies([str(finished), "--generations", "0,last", *few]) == 0
    tests = json.loads(out.read_text())
    names = [f"{finished} generation 0", f"{finished} generation 1"]
    assert [test["name"] for test in tests] == names
    said = capsys.readouterr().out
    assert all(f"{name}, epuck_planar in arena\n" in said for name in names)
    # each is what anybody finds for its genome
    config = load_config(finished / "config.yaml")
    judge = Judges().of("epuck_planar", config.setting)
    genomes = read_arrays(finished / "best_individuals.npz")["genomes"]
    for genome, test in zip(genomes, tests, strict=True):
        assert judge.test(config.topology.decode(genome), 20).mean == test["mean"]


def test_the_hand_written_follower_follows(capsys):
    arguments = ["wall-follower", "--starts", "10", "--robot", "epuck_planar"]
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
    arena.write_text(f"<mujoco><worldbody>{walls}</worldbody></mujoco>")
    arguments = ["--starts", "5", "--arena", str(arena), "--robot", "epuck_planar"]
    assert evaluate_policies([str(finished), *arguments]) == 0
    assert "epuck_planar in small.xml" in capsys.readouterr().out


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


def test_verify_finds_the_same_bits(finished, capsys):
    assert verify([str(finished)]) == 0
    assert verify([str(finished.parent.parent)]) == 0
    assert capsys.readouterr().out.count("1 of 1 champions score the same") == 2


def test_verify_names_what_differs(finished, tmp_path, capsys):
    copy = tmp_path / "run"
    copy.mkdir()
    for name in ("config.yaml", "champion.json", "provenance.json"):
        (copy / name).write_bytes((finished / name).read_bytes())
    fields = json.loads((copy / "champion.json").read_text())
    fields["scores"]["held_out"]["epuck"]["mean"] += 1
    (copy / "champion.json").write_text(json.dumps(fields))
    provenance = json.loads((copy / "provenance.json").read_text())
    provenance["versions"]["mujoco"] = "3.0.0"
    provenance["processor"]["flags"] = ["vax"]
    (copy / "provenance.json").write_text(json.dumps(provenance))
    assert verify([str(copy)]) == 1
    text = capsys.readouterr().out
    assert "epuck" in text
    assert "mujoco 3.0.0 is now " in text
    assert "CPU flags gone: vax" in text
    assert "0 of 1 champions score the same" in text


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda s: s["held_out"]["epuck"].update(crash_rate=0.5), "other crash_rate"),
        (
            lambda s: s["held_out"]["epuck_planar"]["behaviour"].update(spinner=0.5),
            "epuck_planar, the same mean, but other behaviour",
        ),
        (lambda s: s["most_believed"].update(held_out=1.0), "the most believed 1.0 is"),
    ],
    ids=["crash rate", "behaviour", "most believed"],
)
def test_verify_compares_everything_that_is_reported(
    finished, tmp_path, capsys, damage, words
):
    copy = tmp_path / "run"
    shutil.copytree(finished, copy)
    fields = json.loads((copy / "champion.json").read_text())
    damage(fields["scores"])
    (copy / "champion.json").write_text(json.dumps(fields))
    assert verify([str(copy)]) == 1
    assert words in capsys.readouterr().out


def test_verify_needs_a_champion(tmp_path):
    with pytest.raises(UserError, match="no champion in"):
        verify([str(tmp_path)])
    with pytest.raises(UserError, match="expected run or study directories"):
        verify([])


def test_the_most_believed_is_tested_too(finished):
    scores = load_controller(finished / "champion.json").scores
    history = np.genfromtxt(finished / "history.csv", delimiter=",", names=True)
    assert scores["most_believed"]["stored"] == history["best"].max()
    assert 0 <= scores["most_believed"]["held_out"] <= 20


def test_a_robot_that_was_measured(finished, tmp_path):
    path, out = tmp_path / "robot.yaml", tmp_path / "out.json"
    calibration = Calibration((0.7,) * 4 + (1.3,) * 4, (0.02, 0.0204), 0.055)
    calibration.save(path)
    own = ["--calibration", str(path)]
    options = [str(finished), "--starts", "5", "--noise", "calibrated"]
    means = []
    for more in ([], ["--randomise"], own):
        assert evaluate_policies([*options, *more, "--json", str(out)]) == 0
        means.append(tuple(test["mean"] for test in json.loads(out.read_text())))
    assert len(set(means)) == 3
    assert json.loads(out.read_text())[0]["calibration"] == {
        "proximity_gains": list(calibration.proximity_gains),
        "wheel_radii": list(calibration.wheel_radii),
        "track": calibration.track,
    }
    for wrong, message in {
        (str(finished), *own): "calibration needs noise: calibrated or strong, got",
        (*options, *own, "--randomise"): "expected randomise or calibration, got both",
        (*options, "--json", str(tmp_path)): "cannot write .* it is a folder",
        (*options, "--json", "no/out.json"): "cannot write .*no folder 'no'",
        (*options, "--calibration", "no.yaml"): "cannot read 'no.yaml'",
    }.items():
        with pytest.raises(UserError, match=message):
            evaluate_policies(list(wrong))
