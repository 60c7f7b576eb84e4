"""`evolution.verify`: whatever was edited since the run is named, in a line."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import load_controller
from evolution.judging.held_out import Judges
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.generation_loop import Evolution
from evolution.run.means import Means
from evolution.run.results import shown_trials
from evolution.search.search_space import SearchSpace
from evolution.search.table import make_optimizer
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.study.config import StudyConfig
from evolution.verify.__main__ import verify
from evolution.verify.differences import lines_of_differences
from evolution.verify.rewritten import (
    largest_generation,
    stored_without_checkpoint,
)
from evolution.verify.written import read_run
from tests.no_pictures import draw_nothing
from tests.shipped import OPTIMIZERS

SAME = "1 of 1 runs are the same to the last bit"


def finished_run(place: Path, experiment: str, seed: int = 1) -> Path:
    """A tiny run with its checkpoint."""
    fields = load_config(find_config(experiment)).model_dump()
    fields |= {"evaluations": 30, "steps": 20, "trials": 2, "seed": seed}
    fields |= {"validation_starts": 4, "test_starts": 4}
    fields["optimizer"]["population"] = 10
    path = place / experiment / f"seed-{seed}"
    config = ExperimentConfig.parsed(fields, experiment)
    run = Run(config, RunDirectory(path), Means(threads=1), ())
    run.start()
    assert len(list(run.evolve())) == 3
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        run.finish()
    # what stands in for it is no trajectory
    policy = load_controller(path / "champion.json").controller
    judge = Judges(threads=1).of("epuck", config.setting)
    (shown,) = shown_trials(run.evolution, policy, judge, 1)
    shown.save(path / "trajectory.npz")
    return path


@pytest.fixture(scope="module")
def shipped(tmp_path_factory) -> Path:
    """A run without checkpoint and pictures, whose champion is a generation's best."""
    whole = finished_run(tmp_path_factory.mktemp("shipped"), "ga")
    for path in whole.iterdir():
        if path not in RunDirectory(whole).kept:
            path.unlink()
    return whole


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return finished_run(tmp_path_factory.mktemp("whole"), "de-best")


def edited(run: Path, place: Path, name: str, change: Callable) -> Path:
    """A copy of a run of which one file was edited."""
    copy = place / "copy"
    shutil.copytree(run, copy)
    path = copy / name
    if name.endswith(".json"):
        fields = json.loads(path.read_text())
        change(fields)
        path.write_text(json.dumps(fields))
    elif name.endswith(".yaml"):
        fields = yaml.safe_load(path.read_text())
        change(fields)
        path.write_text(yaml.safe_dump(fields))
    elif name.endswith(".npz"):
        arrays = files.read_arrays(path)
        change(arrays)
        files.write_arrays(path, arrays)
    else:
        path.write_text(change(path.read_text()))
    return copy


def verdict(run: Path, capsys) -> list[str]:
    """The lines about a run that is not the same."""
    assert verify([str(run)]) == 1
    first, *lines, last, total = capsys.readouterr().out.splitlines()
    assert first == f"{run}: not the same"
    assert last.startswith("  since then: ")
    assert total == SAME.replace("1", "0", 1)
    assert len(set(lines)) == len(lines) > 0
    assert max(map(len, lines)) < 400
    return lines


def setting(*keys: str | int, to: object) -> Callable:
    def change(fields) -> None:
        for key in keys[:-1]:
            fields = fields[key]
        assert fields[keys[-1]] != to
        fields[keys[-1]] = to

    return change


def adding(name: str, *index: int) -> Callable:
    def change(arrays) -> None:
        arrays[name][index] += 1e-9

    return change


CHAMPION = {
    "stored": (setting("scores", "stored", to=8.9), "scores: stored 8.9 is now "),
    "validation": (
        setting("scores", "validation", to=8.9),
        "scores: validation 8.9 is",
    ),
    "steps": (setting("task", "steps", to=300), "task: steps 300 is now 20"),
    "control step": (setting("task", "control_step", to=0.2), "task: control_step 0.2"),
    "fitness": (setting("task", "fitness", to="literal"), "task: fitness 'literal' is"),
    "sensor range": (
        setting("task", "sensor_range", to=0.05),
        "task: sensor_range 0.",
    ),
    "speed": (setting("task", "speeds", "forward", to=0.1), "task.speeds: forward 0.1"),
    "clearance": (
        setting("scene", "start_clearance", to=0.5),
        "start_clearance 0.5 is",
    ),
    "robot": (setting("scene", "robot", to="epuck"), "scene: robot 'epuck' is now "),
    "arena": (setting("scene", "arena", to="round"), "scene: arena 'round' is now "),
    "model": (
        setting("scene", "mjcf_sha256", "arena", to="0"),
        "mjcf_sha256: arena '0'",
    ),
    "gene": (setting("genome", 3, to=0.5), "3 0.5 is now "),
    "best": (
        setting("scores", "best_stored", "held_out", to=1.0),
        "scores.best_stored: held_out 1.0 is now ",
    ),
    "best stored": (
        setting("scores", "best_stored", "fitness", to=1.0),
        "scores.best_stored: fitness 1.0 is now ",
    ),
    "mean": (
        setting("scores", "held_out", "epuck", "mean", to=19.0),
        "scores.held_out.epuck: mean 19.0 is now ",
    ),
    "behaviour": (
        setting("scores", "held_out", "epuck", "behaviour", "spinner", to=0.5),
        "scores.held_out.epuck: behaviour.spinner 0.5 is now 0.0",
    ),
    "metric": (
        setting("scores", "held_out", "epuck", "metrics", "laps", to=2.0),
        "scores.held_out.epuck: metrics.laps 2.0 is now ",
    ),
    "starts": (
        setting("scores", "held_out", "epuck", "starts", to=1000),
        "scores.held_out.epuck: starts 1000 is now 4",
    ),
    "a robot more": (
        lambda fields: fields["scores"].update(held_out_as_evolved={}),
        "scores: held_out_as_evolved {}, expected none",
    ),
}


# without a checkpoint the best stored is found in another way
@pytest.mark.parametrize(
    ("kind", "what"),
    [
        *(("whole", what) for what in CHAMPION),
        *(("shipped", what) for what in ("stored", "gene", "best", "mean")),
    ],
)
def test_an_edited_champion(what, kind, request, tmp_path, capsys):
    change, words = CHAMPION[what]
    run = request.getfixturevalue(kind)
    lines = verdict(edited(run, tmp_path, "champion.json", change), capsys)
    assert any(words in line for line in lines), lines
    assert all(line.startswith("  champion.json, ") for line in lines)


@pytest.mark.parametrize(
    ("name", "sizes", "expected"),
    [
        ("ga", [100, 100, 100], 100),
        # restarts double it
        ("cma-es", [15, 15, 30], 60),
        ("lra-cma-es", [15, 15, 15], 15),
        # parents are evaluated again from the second generation on
        ("one-plus-one-es", [10, 20, 20], 20),
        ("ssshc", [20, 40, 20], 40),
    ],
)
def test_what_may_be_left_is_less_than_a_generation(name, sizes, expected):
    space = SearchSpace(3, -5, 5, -5, 5)
    optimizer = make_optimizer(OPTIMIZERS[name], space, np.random.default_rng(0))
    spent = np.cumsum(sizes)
    history = {"evaluations": spent, "generation": np.arange(3)}
    assert largest_generation(history, optimizer) == expected
    # tables have some generations only, the first and the last two among them
    last = spent[-1] + sizes[-1] * np.arange(1, 9)
    history = {"evaluations": np.concatenate([spent, last])}
    history["generation"] = np.arange(len(history["evaluations"]))
    thinned = {name: column[[0, 1, 2, 6, 9, 10]] for name, column in history.items()}
    assert largest_generation(thinned, optimizer) == expected


def last_row_less(text: str) -> str:
    return "".join(text.splitlines(keepends=True)[:-1])


OTHER_FILES = {
    "trajectory": (
        "trajectory.npz",
        adding("pose", 1, 0),
        "trajectory.npz, pose: 1.0 ",
    ),
    "best genome": ("best_individuals.npz", adding("genomes", 1, 3), "genomes: 1.3 "),
    "best fitness": ("best_individuals.npz", adding("fitness", 2), "fitness: 2 "),
    "history": ("history.csv", last_row_less, "best: 2 is missing, expected "),
    "mean": (
        "history.csv",
        lambda text: text.replace("\n1,20,", "\n1,20,9"),
        "best: 1 9",
    ),
    "seed": ("config.yaml", setting("seed", to=2), "seed 2 is now 1"),
    "parameter": (
        "config.yaml",
        setting("optimizer", "scale", to=0.5),
        "optimizer.scale 0.5 is now ",
    ),
    "models": (
        "provenance.json",
        setting("mjcf_sha256", "robot", to="0"),
        "mjcf_sha256: robot '0' is now ",
    ),
    "control steps": (
        "timing.csv",
        lambda text: text.replace("\n2,", "\n2,1,7,0.5\n3,"),
        "control_steps: 2 '7' is now ",
    ),
}


@pytest.mark.parametrize("what", OTHER_FILES)
def test_another_edited_file(what, whole, tmp_path, capsys):
    name, change, words = OTHER_FILES[what]
    lines = verdict(edited(whole, tmp_path, name, change), capsys)
    assert all(line.startswith(f"  {name}") for line in lines), lines
    assert any(words in line for line in lines), lines


WITHOUT_CHECKPOINT = {
    "best genome": ("best_individuals.npz", adding("genomes", 1, 3), "genomes: 1.3 "),
    "last fitness": ("best_individuals.npz", adding("fitness", 2), "fitness: 2 "),
    "last row": ("history.csv", last_row_less, "fitness: 2 "),
    "seed": (
        "config.yaml",
        setting("seed", to=2),
        "individuals.npz, genomes: 0.0",
    ),
    "parameter": (
        "config.yaml",
        setting("optimizer", "mutation", to=0.9),
        "best_individuals.npz, genomes: 1.0",
    ),
    "trials": ("config.yaml", setting("trials", to=3), "history.csv, best: 0 "),
    "budget": (
        "config.yaml",
        setting("evaluations", to=40),
        "config.yaml: evaluations 40, but history.csv ends with 30",
    ),
    "steps": ("config.yaml", setting("steps", to=10), "task: steps 20 is now 10"),
}


@pytest.mark.parametrize("what", WITHOUT_CHECKPOINT)
def test_an_edited_file_of_a_run_without_checkpoint(what, shipped, tmp_path, capsys):
    name, change, words = WITHOUT_CHECKPOINT[what]
    lines = verdict(edited(shipped, tmp_path, name, change), capsys)
    assert any(words in line for line in lines), lines


def test_what_nobody_edited_is_the_same(whole, shipped, capsys):
    for run in (whole, shipped, whole.parent.parent):
        assert verify([str(run)]) == 0
        assert SAME in capsys.readouterr().out


def test_the_study_knows_the_config(shipped, tmp_path, capsys):
    """Where a run has no checkpoint, and even its seed was edited."""
    study = tmp_path / "study"
    shutil.copytree(shipped.parent, study / "ga")
    config = load_config(shipped / "config.yaml")
    (study / "study.yaml").write_text(StudyConfig({"ga": config}).to_yaml())
    assert verify([str(study)]) == 0
    assert SAME in capsys.readouterr().out
    other = config.model_copy(update={"seed": 9, "evaluations": 31})
    (study / "ga/seed-1/config.yaml").write_text(other.to_yaml())
    lines = verdict(study / "ga" / "seed-1", capsys)
    assert lines == ["  config.yaml: seed 9 is now 1, evaluations 31 is now 30"]


def test_a_champion_that_was_never_the_best(tmp_path):
    """Without the checkpoint, its fitness is what it earned in some generation."""
    run = finished_run(tmp_path, "de-best")
    arrays = files.read_arrays(run / "checkpoint.npz")
    population, fitness = (arrays[f"optimizer.{n}"] for n in ("population", "fitness"))
    best = files.read_arrays(run / "best_individuals.npz")["genomes"]
    among = (population[:, None] == best).all(axis=-1).any(axis=1)
    other = int(np.flatnonzero(~among)[0])
    (run / "checkpoint.npz").unlink()
    for claimed, is_so in ((fitness[other], True), (8.9, False)):
        fields = json.loads((run / "champion.json").read_text())
        fields["genome"] = population[other].tolist()
        fields["scores"]["stored"] = claimed
        (run / "champion.json").write_text(json.dumps(fields))
        written = read_run(RunDirectory(run))
        evolution = Evolution(written.source, threads=1)
        stored = stored_without_checkpoint(written, evolution)
        assert (stored.fitness[0] == claimed) == is_so


def test_what_an_older_file_does_not_say(shipped, tmp_path, capsys):
    run = edited(
        shipped, tmp_path, "champion.json", lambda f: f["scene"].pop("start_clearance")
    )
    assert verify([str(run)]) == 0
    said = capsys.readouterr().out
    assert f"{run}: the same to the last bit; champion.json does not say " in said
    assert "scene.start_clearance" in said


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        (
            "provenance.json",
            setting("processor", "flags", to=5),
            "processor.flags: Input should be a valid list",
        ),
        (
            "champion.json",
            setting("scores", "stored", to="8.9"),
            "stored: expected a number",
        ),
        ("history.csv", lambda text: text[:60], "is damaged"),
        ("history.csv", lambda text: "", "is damaged"),
    ],
)
def test_damage_is_named_before_any_work(
    name, change, words, shipped, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("evolution.judging.held_out.Judges", None)
    run = edited(shipped, tmp_path, name, change)
    assert verify([str(run)]) == 1
    line, total = capsys.readouterr().out.splitlines()
    assert line.startswith(f"{run}: '{run / name}' is damaged: ")
    assert words in line
    assert total == SAME.replace("1", "0", 1)


def test_a_lost_champion_is_named_and_the_others_are_verified(
    whole, shipped, tmp_path, capsys
):
    study = tmp_path / "study"
    shutil.copytree(shipped, study / "ga" / "seed-1")
    shutil.copytree(whole, study / "de-best" / "seed-1")
    (study / "de-best/seed-1/champion.json").unlink()
    assert verify([str(study)]) == 1
    first, second, total = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{study}/de-best/seed-1: ")
    assert "no champion" in first or "champion.json" in first
    assert second == f"{study}/ga/seed-1: the same to the last bit"
    assert total == "1 of 2 runs are the same to the last bit"


def test_versions_and_processors_that_differ_are_named(shipped, tmp_path, capsys):
    run = edited(shipped, tmp_path, "champion.json", CHAMPION["stored"][0])
    provenance = json.loads((run / "provenance.json").read_text())
    provenance["versions"]["mujoco"] = "3.0.0"
    provenance["processor"]["flags"] = ["vax"]
    (run / "provenance.json").write_text(json.dumps(provenance))
    assert verify([str(run)]) == 1
    text = capsys.readouterr().out
    assert "mujoco 3.0.0 is now " in text
    assert "CPU flags gone: vax" in text


def test_verify_needs_a_run(tmp_path):
    with pytest.raises(UserError, match="no champion in"):
        verify([str(tmp_path)])
    with pytest.raises(UserError, match="expected run or study directories"):
        verify([])


def test_lines_of_differences():
    before = {"a": 1.0, "b": [1, 2], "c": {"d": "x", "e": 3}, "f": 9}
    assert lines_of_differences("file", before, json.loads(json.dumps(before))) == []
    now = {"a": 1, "b": [1, 3, 4], "c": {"d": "y", "e": 3}, "g": None}
    assert lines_of_differences("file", before, now) == [
        "file: a 1.0 is now 1, g is missing, expected None, f 9, expected none",
        "file, b: 1 2 is now 3, 2 is missing, expected 4",
        "file, c: d 'x' is now 'y'",
    ]
    (line,) = lines_of_differences("file", {"b": [0] * 9}, {"b": [1] * 9})
    assert line.endswith("2 0 is now 1 and 6 more")
