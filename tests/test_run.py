"""`python -m evolution.run`: what it leaves behind, and that nothing can break it."""

import errno
import hashlib
import json
import math
import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.image import imread
from rerun.chunk import RrdReader

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import load_controller
from epuck_mj.scene.model_files import MODELS
from epuck_mj.step.calibration import Calibration
from epuck_mj.trials.trajectory import Trajectory
from evolution.judging.scores import Scores
from evolution.run import __main__ as run_command
from evolution.run import execution
from evolution.run.__main__ import evolve
from evolution.run.directory import RunDirectory
from evolution.run.history import HISTORY, Record
from evolution.run.lock import LOCK
from evolution.run.progress import Progress
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import (
    CONFIGS,
    find_config,
    load_config,
    shipped_experiments,
)
from tests.no_pictures import draw_nothing
from tests.processes import PATIENCE, python_process
from tests.shipped import OPTIMIZERS

FEW = ["--validation-starts", "5", "--test-starts", "5"]
SMALL = ["--steps", "20", "--trials", "2", "--population", "10", *FEW]
SHORT = [*SMALL, "--evaluations", "20"]
TINY = [*SMALL, "--evaluations", "60"]
LONG = [*SMALL, "--evaluations", "240"]
LONG_GENERATIONS = 23
"""After the climb, the population is evaluated twice."""

PROMISED = {
    "config.yaml",
    "provenance.json",
    "history.csv",
    "best_individuals.npz",
    "timing.csv",
    "checkpoint.npz",
    "champion.json",
    "fitness.png",
    "trajectory.npz",
    "trajectory.png",
    "champion.rrd",
}
THERE = PROMISED | {LOCK}
DRAWN = {"fitness.png", "trajectory.npz", "trajectory.png", "champion.rrd"}
REPRODUCED = ("history.csv", "champion.json")


# processes


def evolution(cwd: Path, *argv: str, **variables) -> subprocess.CompletedProcess[str]:
    """The finished process of a command line."""
    command = ("-m", "evolution.run", *argv)
    with python_process(*command, cwd=cwd, env=os.environ | variables) as process:
        stdout, stderr = process.communicate(timeout=PATIENCE)
    return subprocess.CompletedProcess(argv, process.returncode, stdout, stderr)


UNHURRIED = """
import math, time
from epuck_mj.host.command_line import main
from evolution.run import execution, directory as run_directory, __main__ as run

class RunDirectory(run_directory.RunDirectory):
    def save(self, *arguments):
        super().save(*arguments)
        time.sleep(0.05)

run.RunDirectory = RunDirectory
execution.SAVING_SHARE = math.inf
main(run.evolve)
"""
"""`evolution.run` that saves every generation and leaves time to look at it."""


def wait_for(process: subprocess.Popen, moment: Callable[[], bool]) -> None:
    """Wait until then, or until the process has ended."""
    deadline = time.monotonic() + PATIENCE
    while not moment() and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.005)


def n_records(directory: Path) -> int:
    """Generations in the checkpoint, which can be read at any moment."""
    if not (directory / "checkpoint.npz").exists():
        return 0
    return len(files.read_arrays(directory / "checkpoint.npz")["records"])


def n_rows(directory: Path) -> int:
    """Generations in history.csv."""
    if not (directory / "history.csv").exists():
        return 0
    header, *rows = (directory / "history.csv").read_text().splitlines()
    assert header == ",".join([*HISTORY, "robot"])
    return len(rows)


def assert_reproduced(directory: Path, reference: Path) -> None:
    for name in REPRODUCED:
        assert (directory / name).read_bytes() == (reference / name).read_bytes(), name


# in this process


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty directory that is the working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def no_pictures(monkeypatch):
    """Nothing is drawn."""
    draw_nothing(monkeypatch)


@pytest.fixture
def every_generation_saved(monkeypatch):
    """However short it is."""
    monkeypatch.setattr(execution, "SAVING_SHARE", math.inf)


def tree(directory: Path) -> dict[str, str]:
    """Everything below a directory but locks, with a hash of the content of files."""
    return {
        str(path.relative_to(directory)): hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else "directory"
        for path in sorted(directory.rglob("*"))
        if path.name != LOCK
    }


@pytest.fixture
def refusal(here, capfd):
    """Runs a command line that must be refused, and gives the message."""

    def refused(*argv: str) -> str:
        before = tree(here)
        with pytest.raises(UserError) as info:
            evolve(argv)
        message = str(info.value)
        assert message.strip()
        assert "\n" not in message
        # nothing left behind, nothing changed, nothing else said
        assert tree(here) == before
        assert capfd.readouterr() == ("", "")
        return message

    return refused


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished run, as a process of its own: where it is and what it said."""
    cwd = tmp_path_factory.mktemp("finished")
    process = evolution(cwd, "ga", "--seed", "7", *TINY, "--output", "run")
    assert process.returncode == 0, process.stderr
    return cwd / "run", process


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """A longer run that nothing interrupted."""
    directory = tmp_path_factory.mktemp("reference") / "run"
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        assert evolve(["ga", "--seed", "7", *LONG, "--output", str(directory)]) == 0
    return directory


@pytest.fixture
def unfinished(finished, here):
    """A copy of the finished run in which the champion is still to be chosen."""
    directory = here / "run"
    shutil.copytree(finished[0], directory)
    for name in ("champion.json", "fitness.png", "champion.rrd"):
        (directory / name).unlink()
    provenance = json.loads((directory / "provenance.json").read_text())
    (directory / "provenance.json").write_text(
        json.dumps({**provenance, "finished": None})
    )
    return directory


# what a run leaves behind


def test_all_promised_files_are_there_and_nothing_else(finished):
    directory, _ = finished
    assert {path.name for path in directory.iterdir()} == THERE


def test_history(finished):
    directory, _ = finished
    header, *rows = (directory / "history.csv").read_text().splitlines()
    assert header == "generation,evaluations,best,mean,std,robot"
    assert [row.split(",")[:2] for row in rows] == [
        [str(i), str(10 * (i + 1))] for i in range(6)
    ]


def test_timing(finished):
    directory, _ = finished
    header, *rows = (directory / "timing.csv").read_text().splitlines()
    assert header == "generation,seconds,control_steps,crash_rate"
    columns = list(zip(*(row.split(",") for row in rows), strict=True))
    assert columns[0] == tuple(map(str, range(6)))
    assert all(float(seconds) >= 0 for seconds in columns[1])
    # 10 individuals, 2 trials of at most 20 steps, and one that crashes took one
    assert all(20 <= int(steps) <= 400 for steps in columns[2])
    assert all(0 <= float(crashed) <= 1 for crashed in columns[3])


def test_the_stored_config_is_the_resolved_one(finished):
    directory, _ = finished
    shipped = load_config(find_config("ga")).model_dump()
    shipped |= {"seed": 7, "steps": 20, "evaluations": 60, "trials": 2}
    shipped |= {"validation_starts": 5, "test_starts": 5}
    shipped["optimizer"]["population"] = 10
    assert load_config(directory / "config.yaml").model_dump() == shipped


def test_provenance(finished):
    directory, _ = finished
    provenance = json.loads((directory / "provenance.json").read_text())
    assert provenance["argv"] == ["ga", "--seed", "7", *TINY, "--output", "run"]
    assert (provenance["engine"], provenance["threads"]) == ("batch", 0)
    for package in ("python", "mujoco", "dm-control", "numpy", "scipy", "rerun-sdk"):
        assert re.match(r"\d+\.\d+", provenance["versions"][package])
    assert set(provenance["mjcf_sha256"]) == {"arena", "robot"}
    assert all(
        re.fullmatch("[0-9a-f]{64}", h) for h in provenance["mjcf_sha256"].values()
    )
    assert provenance["processor"]["machine"]
    if sys.platform == "linux":
        assert provenance["processor"]["flags"]
    if provenance["git"] is not None:
        assert re.fullmatch("[0-9a-f]{40}", provenance["git"]["commit"])
        assert isinstance(provenance["git"]["modified"], bool)
    assert provenance["started"] <= provenance["finished"]
    assert "resumed" not in provenance


def test_the_checkpoint_holds_every_generation(finished):
    directory, _ = finished
    with np.load(directory / "checkpoint.npz", allow_pickle=False) as file:
        assert file["records"].shape == (6, 8)
        assert file["best_genomes"].shape == (6, 40)
        assert file["optimizer.fitness"].shape == (10,)


def test_the_champions_file_pictures_and_recordings_can_be_read(finished):
    directory, _ = finished
    stored = load_controller(directory / "champion.json")
    assert stored.genome.shape == (40,)
    assert list(stored.scores["held_out"]) == ["epuck", "epuck_kinematic"]
    assert 1 <= Trajectory.load(directory / "trajectory.npz").steps <= 20
    for name in ("fitness.png", "trajectory.png"):
        picture = imread(directory / name)
        assert min(picture.shape[:2]) > 300
        assert picture[..., :3].std() > 0.01
    assert len(list(RrdReader(directory / "champion.rrd").stream())) > 0


def test_the_summary_is_in_plain_words(finished):
    directory, process = finished
    scores = load_controller(directory / "champion.json").scores
    first, *scored, written, replay = process.stdout.splitlines()
    assert re.fullmatch(
        r"ga, seed 7: 60 evaluations in 6 generations, \d+ min \d+ s", first
    )
    expected = Scores.read(scores, directory / "champion.json").in_lines(20.0)
    assert scored == expected.splitlines()
    assert scored[0].startswith("The champion earns ")
    assert written == f"Written to run: {', '.join(sorted(PROMISED))}"
    assert replay.startswith("Replay: ")
    assert replay.endswith(" -m evolution.replay run")


def test_progress_is_on_stderr_one_line_for_a_generation(finished):
    _, process = finished
    lines = process.stderr.splitlines()
    stages = [line for line in lines[6:] if line.endswith(" ...")]
    assert stages == lines[6:]
    assert stages[0] == "Choosing the champion on 5 fresh starts ..."
    assert stages[-1] == "Recording the champion ..."
    assert len(stages) == 6
    for i, line in enumerate(lines[:6]):
        pattern = rf" *{10 * (i + 1)} of 60 evaluations: gen={i} best=.* crash=\d+%"
        assert re.fullmatch(pattern, line)


# the forms of the command line


def test_own_yaml_default_output_and_the_same_seed_twice(finished, here):
    """`my.yaml --threads 1`: a file in place of the flags, another process."""
    config = load_config(find_config("ga")).model_dump()
    config |= {"seed": 7, "steps": 20, "evaluations": 60, "trials": 2}
    config |= {"validation_starts": 5, "test_starts": 5}
    config["optimizer"]["population"] = 10
    (here / "my.yaml").write_text(yaml.safe_dump(config))
    assert evolve(["my.yaml", "--threads", "1"]) == 0
    assert sorted(path.name for path in here.iterdir()) == ["my.yaml", "runs"]
    directory = here / "runs" / "my-seed-7"
    assert {path.name for path in directory.iterdir()} == THERE
    assert_reproduced(directory, finished[0])
    # pictures and recordings of the same run are the same too
    for name in ("config.yaml", "fitness.png", "trajectory.png", "trajectory.npz"):
        assert (directory / name).read_bytes() == (finished[0] / name).read_bytes()


def test_default_output_is_named_by_experiment_and_seed(here, no_pictures):
    assert evolve(["de-rand", "--seed", "3", *SHORT]) == 0
    assert evolve(SHORT) == 0
    names = sorted(path.name for path in (here / "runs").iterdir())
    assert names == ["de-best-seed-1", "de-rand-seed-3"]


def test_print_config_writes_nothing_and_loads_back(here, capfd):
    assert evolve(["ga", "--seed", "7", *TINY, "--print-config"]) == 0
    printed, said = capfd.readouterr()
    assert said == ""
    assert not any(here.iterdir())
    (here / "back.yaml").write_text(printed)
    config = load_config(here / "back.yaml")
    assert (config.seed, config.steps) == (7, 20)
    assert config.model_dump()["optimizer"]["population"] == 10
    assert config.to_yaml() == printed


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_print_config_of_a_shipped_experiment(name, here, capsys):
    assert evolve([name, "--print-config"]) == 0
    assert capsys.readouterr().out == load_config(find_config(name)).to_yaml()
    # a printed config is an experiment: the same again
    (here / "mine.yaml").write_text(load_config(find_config(name)).to_yaml())
    assert evolve(["mine.yaml", "--print-config"]) == 0
    assert capsys.readouterr().out == load_config(find_config(name)).to_yaml()


def test_a_flag_wins_over_the_yaml(here, capsys):
    text = (CONFIGS / "ga.yaml").read_text() + "seed: 5\nbiases: false\n"
    (here / "mine.yaml").write_text(text)
    flags = "--seed 6 --biases --control-step 0.2 --mutation 0.5 --robot epuck"
    assert evolve(["mine.yaml", *flags.split(), "--print-config"]) == 0
    printed = yaml.safe_load(capsys.readouterr().out)
    assert (printed["seed"], printed["biases"]) == (6, True)
    assert (printed["control_step"], printed["robot"]) == (0.2, "epuck")
    assert printed["optimizer"]["mutation"] == 0.5
    assert printed["trials"] == 5


def test_a_measured_robot_is_a_flag(here, capsys):
    robot = Calibration(track=0.055)
    robot.save(here / "robot.yaml")
    flags = ["ga", "--calibration", "robot.yaml", "--print-config"]
    assert evolve([*flags, "--noise", "calibrated"]) == 0
    printed = ExperimentConfig.from_yaml(capsys.readouterr().out, "printed")
    assert printed.calibration == robot
    # and one of the YAML's can be taken away
    printed_again = [
        str(here / "mine.yaml"),
        "--calibration",
        "none",
        "--noise",
        "none",
    ]
    (here / "mine.yaml").write_text(printed.to_yaml())
    assert evolve([*printed_again, "--print-config"]) == 0
    without = ExperimentConfig.from_yaml(capsys.readouterr().out, "printed")
    assert without == load_config(find_config("ga"))
    message = "^calibration needs noise: calibrated or strong, got none$"
    with pytest.raises(UserError, match=message):
        evolve(flags)


def test_help_ends_well(capsys):
    with pytest.raises(SystemExit) as info:
        evolve(["ga", "--help"])
    assert not info.value.code
    assert "--tournament" in capsys.readouterr().out


def test_help_names_every_experiment():
    named = (run_command.Options.__doc__ or "").partition("(")[2].partition(") or")[0]
    assert {each.strip() for each in named.split(",")} == set(shipped_experiments())


def test_resume_of_a_finished_run_changes_nothing(finished, here, capsys):
    before = tree(finished[0])
    assert evolve(["--resume", str(finished[0])]) == 0
    assert "is finished; Replay: " in capsys.readouterr().out
    assert tree(finished[0]) == before


LOSSES = {
    **{name: lambda path: path.unlink() for name in sorted(PROMISED - DRAWN)},
    "champion.json cut": lambda path: path.write_bytes(path.read_bytes()[:500]),
    "champion.json text": lambda path: path.write_text("not mine"),
    "history.csv empty": lambda path: path.write_bytes(b""),
    "best_individuals.npz cut": lambda path: path.write_bytes(path.read_bytes()[:99]),
}
# without it nothing can be written again, and without this nothing is known to be done
del LOSSES["checkpoint.npz"], LOSSES["provenance.json"]


@pytest.mark.parametrize("loss", LOSSES)
def test_what_a_finished_run_has_lost_is_written_again(
    loss, finished, here, no_pictures, capsys
):
    shutil.copytree(finished[0], here / "run")
    name = loss.split()[0]
    LOSSES[loss](here / "run" / name)
    assert evolve(["--resume", "run"]) == 0
    out, error = capsys.readouterr()
    assert "written again: " in error
    assert name in error
    assert "is finished" not in out
    for each in ("config.yaml", *REPRODUCED, "best_individuals.npz"):
        assert (here / "run" / each).read_bytes() == (finished[0] / each).read_bytes()
    # how long the generations took cannot be known again
    timing = [(path / "timing.csv").read_text() for path in (here / "run", finished[0])]
    untimed = [re.sub(r"(?m)^(\d+),[\d.]*,", r"\1,,", text) for text in timing]
    assert untimed[0] == untimed[1]
    assert RunDirectory(here / "run").finished
    assert evolve(["--resume", "run"]) == 0
    assert "run is finished; Replay: " in capsys.readouterr().out


def test_lost_pictures_are_drawn_again(finished, here):
    shutil.copytree(finished[0], here / "run")
    for name in DRAWN:
        (here / "run" / name).unlink()
    assert not RunDirectory(here / "run").finished
    assert evolve(["--resume", "run"]) == 0
    assert RunDirectory(here / "run").finished
    for name in DRAWN - {"champion.rrd"}:
        again, before = (path / name for path in (here / "run", finished[0]))
        assert again.read_bytes() == before.read_bytes(), name


def test_a_copy_without_checkpoint_is_finished_but_cannot_be_mended(
    finished, here, refusal, capfd
):
    run = RunDirectory(here / "run")
    run.path.mkdir()
    for path in RunDirectory(finished[0]).kept:
        shutil.copy(path, run.path)
    assert evolve(["--resume", "run"]) == 0
    assert "run is finished" in capfd.readouterr().out
    run.champion.unlink()
    assert not run.finished
    # it would begin again, and overwrite the histories
    message = refusal("--resume", "run")
    assert message.startswith("cannot resume 'run': 'checkpoint.npz' is missing")


def test_a_run_on_an_own_robot_of_another_name(here, no_pictures, capsys):
    shutil.copy(MODELS / "epuck.xml", here / "mine.xml")
    (here / "out").mkdir()
    # an empty directory is as good as none
    assert evolve(["ga", *SHORT, "--robot", "mine.xml", "--output", "out"]) == 0
    out = capsys.readouterr().out
    assert "5 fresh starts on epuck; " in out
    assert "On mine.xml " in out
    origin = load_controller("out/champion.json").origin
    assert origin.robot == str(here / "mine.xml")
    assert set(origin.mjcf_sha256) == {"arena", "robot"}
    # the same robot by its name is the same run
    assert evolve(["ga", *SHORT, "--robot", "epuck", "--output", "named"]) == 0
    history = (here / "named" / "history.csv").read_text()
    own = (here / "out" / "history.csv").read_text()
    assert own.replace(",mine\n", ",epuck\n") == history


def test_the_wheeled_robot_is_tested_without_physics_as_well(here, no_pictures, capsys):
    assert evolve(["ga", *SHORT, "--robot", "epuck", "--output", "out"]) == 0
    out = capsys.readouterr().out
    assert out.count("The champion earns ") == 1
    assert "On epuck_kinematic " in out
    tests = load_controller("out/champion.json").scores["held_out"]
    assert list(tests) == ["epuck", "epuck_kinematic"]


def test_the_engine_changes_nothing(here, no_pictures):
    for engine in ("batch", "dm_control"):
        how = ["--robot", "epuck", "--engine", engine, "--output", engine]
        assert evolve(["ga", *SHORT, *how]) == 0
    assert_reproduced(here / "dm_control", here / "batch")


# bad input


WALLS = (
    ("0.01 0.52 0.03", "0.51 0 0.03"),
    ("0.01 0.52 0.03", "-0.51 0 0.03"),
    ("0.5 0.01 0.03", "0 0.51 0.03"),
    ("0.5 0.01 0.03", "0 -0.51 0.03"),
)


def arena(walls=WALLS) -> str:
    geoms = "".join(f'<geom type="box" size="{s}" pos="{p}"/>' for s, p in walls)
    floor = '<geom type="plane" size="1 1 1" contype="2" conaffinity="2"/>'
    return f"<mujoco><worldbody>{floor}{geoms}</worldbody></mujoco>"


GA = "optimizer: {algorithm: genetic_algorithm}\n"
FULL = (MODELS / "epuck.xml").read_text()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("populaton: 3\n" + GA, ("unknown key 'populaton'", "available: seed, ")),
        ("optimizer: {algorithm: genetic_algorithm, bit: 3}", ("'optimizer.bit'",)),
        ("trials: many\n" + GA, ("trials: ", "'many'")),
        ("seed: 1\n", ("'optimizer' is missing",)),
        ("seed: [1\n", ("is not YAML",)),
        ("- 1\n", ("expected a mapping",)),
        ("evaluations: 99\n" + GA, ("at least one generation, 100", "got 99")),
        ("weight_init: 1.0\n" + GA, ("initial range",)),
    ],
)
def test_a_bad_experiment_file_is_refused(content, words, refusal, here):
    (here / "mine.yaml").write_text(content)
    message = refusal("mine.yaml", "--output", "out")
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["nope"], ("no experiment 'nope'", "de-rand, ga")),
        (["missing.yaml"], ("no experiment 'missing.yaml'",)),
        (["ga", "--populaton", "3"], ("--populaton",)),
        (["ga", "--strategy", "best"], ("--strategy",)),
        (["ga", "de-best"], ("de-best",)),
        (
            ["--seed", "3", "ga"],
            ("the experiment as the first argument", "evolution.run ga"),
        ),
        (["ga", "--seed", "x"], ("--seed", "'x'")),
        (["ga", "--seed", "-1"], ("seed", "-1")),
        (["ga", "--seed"], ("--seed",)),
        (["ga", "--steps", "0"], ("steps", "0")),
        (["ga", "--v-max", "nan"], ("v_max", "nan")),
        (["ga", "--fitness", "sum"], ("'sum'", "product", "literal")),
        (["ga", "--engine", "stage"], ("'stage'", "batch", "dm_control")),
        (["ga", "--elites", "200"], ("elites: expected 0 to population - 1",)),
        (["de-best", "--strategy", "bst"], ("unknown strategy 'bst'",)),
        (
            ["ga", "--threads", "-1"],
            ("--threads: ", "1,024, got -1"),
        ),
        (["ga", "--threads", "two"], ("--threads", "'two'")),
        (["ga", "--evaluations", "99"], ("one generation, 100", "got 99")),
        (["ga", "--control-step", "0.0333"], ("multiple", "got 0.0333 s")),
        (["ga", "--control-step", "0.0001"], ("multiple", "got 0.0001 s")),
        (["ga", "--start-clearance", "0.6"], ("no room for a start",)),
        (["ga", "--robot", "nope"], ("no robot 'nope'", "epuck_kinematic, epuck")),
        (["ga", "--arena", "nope"], ("no arena 'nope'", "arena")),
        (["--resume"], ("--resume",)),
        (["--resume", "nowhere"], ("no run in 'nowhere'", "nowhere/config.yaml")),
        (["--resume", "a", "--output", "b", "ga"], ("no run in 'a'",)),
    ],
)
def test_bad_arguments_are_refused(argv, words, refusal):
    message = refusal(*argv)
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco>\n<worldbody>\n</mujoco>", ("not well-formed XML", "line 3")),
        ("", ("not well-formed XML",)),
        ("<mujoco><worldbdy/></mujoco>", ("MuJoCo cannot compile", "worldbdy")),
        (arena(walls=()), ("has no walls",)),
        (arena(walls=WALLS[:3]), ("no room for a start",)),
        (arena().replace("0.51", "0.05"), ("no room for a start",)),
    ],
)
def test_a_bad_arena_is_refused(text, words, refusal, here):
    (here / "mine.xml").write_text(text)
    message = refusal("ga", *TINY, "--arena", "mine.xml", "--output", "out")
    for word in ("mine.xml", *words):
        assert word in message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda text: re.sub('<rangefinder name="ps3".*?/>', "", text),
            ("no sensor 'ps3'", "available: ps0, ps1, ps2, ps4"),
        ),
        (
            lambda text: text.replace(
                '<velocity name="wheel_left"', '<velocity name="left"'
            ),
            ("no actuator 'wheel_left'", "available: left, wheel_right"),
        ),
        (
            lambda text: text.replace('name="epuck"', 'name="robot"'),
            ("no body 'epuck'",),
        ),
        (
            lambda text: text.replace("<freejoint", '<joint type="ball"'),
            ("mine.xml", "expected body 'epuck' with a free joint, got ball"),
        ),
        (lambda text: text[: len(text) // 2], ("mine.xml",)),
        (lambda text: text.replace("site=", "place=", 1), ("mine.xml",)),
    ],
)
def test_a_bad_robot_is_refused(change, words, refusal, here):
    text = change(FULL)
    assert text != FULL
    (here / "mine.xml").write_text(text)
    message = refusal("ga", *TINY, "--robot", "mine.xml", "--output", "out")
    for word in words:
        assert word in message


def test_an_output_that_is_used_is_refused(refusal, here):
    (here / "out").mkdir()
    (here / "out" / "thesis.tex").write_text("years of work")
    (here / "file").write_text("")
    message = refusal("ga", *TINY, "--output", "out")
    assert "'out' is not empty" in message
    assert "--resume out" in message
    assert "not a directory" in refusal("ga", *TINY, "--output", "file")
    assert "cannot write" in refusal("ga", *TINY, "--output", "file/deeper/run")


def test_a_changed_config_is_refused_on_resume(refusal, unfinished):
    message = refusal("--resume", "run", "--seed", "8", "--mutation", "0.5")
    keys = re.findall(r"[\w.]+(?= \(stored)", message)
    assert keys == ["seed", "optimizer.mutation"]
    assert "seed (stored 7, got 8)" in message
    message = refusal("de-best", *TINY, "--seed", "7", "--resume", "run")
    assert "optimizer.algorithm (stored genetic_algorithm" in message
    assert "optimizer.strategy (stored None, got best)" in message


def test_resume_and_output_together_are_refused(refusal, unfinished):
    message = refusal("--resume", "run", "--output", "other")
    assert message == "expected --resume or --output, got both"


def test_the_same_config_by_its_flags_can_be_resumed(unfinished, finished, no_pictures):
    assert evolve(["ga", "--seed", "7", *TINY, "--resume", "run"]) == 0
    history = (unfinished / "history.csv").read_bytes()
    assert history == (finished[0] / "history.csv").read_bytes()


@pytest.mark.parametrize("size", [0, 100, 1000, -1])
def test_a_truncated_checkpoint_is_refused_and_kept(size, refusal, unfinished):
    path = unfinished / "checkpoint.npz"
    path.write_bytes(path.read_bytes()[:size])
    # `refusal` sees that the file stays as it was
    assert "run/checkpoint.npz" in refusal("--resume", "run")


@pytest.mark.parametrize("content", [b"PK", b"\x93NUMPY"])
def test_a_checkpoint_that_is_none_is_refused(content, refusal, unfinished):
    (unfinished / "checkpoint.npz").write_bytes(content)
    assert "run/checkpoint.npz" in refusal("--resume", "run")


def test_a_checkpoint_of_another_algorithm_or_size_is_refused(
    refusal, unfinished, here, no_pictures, capfd
):
    path = unfinished / "checkpoint.npz"
    for argv in (["de-best", *SHORT], ["ga", *SHORT, "--population", "12"]):
        other = f"other-{len(argv)}"
        assert evolve([*argv, "--output", other]) == 0
        capfd.readouterr()
        shutil.copy(here / other / "checkpoint.npz", path)
        assert "not a checkpoint of this run" in refusal("--resume", "run")


def test_bad_input_ends_a_process_with_one_line_and_status_2(tmp_path):
    """On a terminal without Unicode too."""
    argv = ["ga", "--seed", "x", "--output", "out"]
    process = evolution(tmp_path, *argv, PYTHONIOENCODING="ascii")
    assert (process.returncode, process.stdout) == (2, "")
    assert process.stderr.startswith("error: ")
    assert process.stderr.count("\n") == 1
    assert process.stderr.endswith("\n")
    assert "--seed" in process.stderr
    assert not any(tmp_path.iterdir())


# interrupted


def resume_command(stderr: str) -> list[str]:
    """The arguments that the last line tells a person to type."""
    line = stderr.splitlines()[-1]
    match = re.fullmatch(
        r"Interrupted after ([\d,]+) evaluations; continue with: (.*)", line
    )
    assert match, stderr
    python, dash_m, module, *argv = shlex.split(match[2])
    assert Path(python).name.startswith("python")
    assert (dash_m, module) == ("-m", "evolution.run")
    return argv


@pytest.mark.slow
@pytest.mark.parametrize(
    ("signum", "status", "generations"),
    [
        (signal.SIGINT, 130, 3),
        # all are there: the champion is being chosen
        (signal.SIGTERM, 143, LONG_GENERATIONS),
    ],
    ids=["SIGINT", "SIGTERM-champion"],
)
def test_a_signal_ends_the_run_and_says_how_to_resume(
    signum, status, generations, reference, tmp_path, no_pictures, monkeypatch
):
    argv = ["ga", "--seed", "7", *LONG, "--output", "some where"]
    directory = tmp_path / "some where"
    with python_process("-c", UNHURRIED, *argv, cwd=tmp_path) as process:
        wait_for(process, lambda: n_rows(directory) >= generations)
        process.send_signal(signum)
        stdout, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == status, stderr
    assert stdout == ""
    assert "Traceback" not in stderr
    assert "Exception ignored" not in stderr
    assert generations <= n_rows(directory) <= n_records(directory)
    assert json.loads((directory / "provenance.json").read_text())["finished"] is None
    assert not (directory / "champion.rrd").exists()
    # no half-written file
    assert not files.leftovers(directory)
    monkeypatch.chdir(tmp_path)
    assert evolve(resume_command(stderr)) == 0
    assert_reproduced(directory, reference)
    provenance = json.loads((directory / "provenance.json").read_text())
    assert provenance["argv"] == argv
    assert [each["argv"] for each in provenance["resumed"]] == [
        ["--resume", "some where"]
    ]
    assert provenance["finished"]


@pytest.mark.slow
def test_kill_9_at_any_moment_loses_at_most_one_generation(
    reference, here, no_pictures
):
    directory, done = here / "run", 0
    argv = ["ga", "--seed", "7", *LONG, "--output", "run"]
    moments = [
        lambda: (directory / "config.yaml").exists(),
        lambda: n_records(directory) > done,
        lambda: n_records(directory) == LONG_GENERATIONS,
    ]
    for moment in moments:
        with python_process("-c", UNHURRIED, *argv, cwd=here) as process:
            wait_for(process, moment)
            time.sleep(random.uniform(0, 0.2))
            process.kill()
            _, stderr = process.communicate(timeout=PATIENCE)
        assert process.returncode in (-signal.SIGKILL, 0), stderr
        records = n_records(directory)
        announced = [int(each) for each in re.findall(r"gen=(\d+)", stderr)]
        # what was there and what was said to be done is there; goes on, not again
        assert records >= max([done, *(each + 1 for each in announced)])
        assert announced[:1] in ([], [done])
        assert records - 1 <= n_rows(directory) <= records
        done, argv = records, ["--resume", "run"]
    assert evolve(argv) == 0
    assert_reproduced(directory, reference)
    assert n_records(directory) == LONG_GENERATIONS
    assert {path.name for path in directory.iterdir()} == THERE
    timed = (directory / "timing.csv").read_text().split()[1:]
    assert [int(row.split(",")[0]) for row in timed] == list(range(LONG_GENERATIONS))
    # a kill may take the seconds of generations, never their control steps
    assert all(int(row.split(",")[2]) > 0 for row in timed)
    resumed = json.loads((directory / "provenance.json").read_text())["resumed"]
    assert 1 <= len(resumed) <= len(moments)


@pytest.mark.slow
def test_resume_from_between_any_two_writes(here, no_pictures, monkeypatch):
    """What a kill would leave before and after each file, one after the other."""
    moments, write = [], files.write_bytes

    def watched(path: Path, content: bytes) -> None:
        write(path, content)
        moments.append((path.name, f"{len(moments)}"))
        shutil.copytree("whole", moments[-1][1])

    with monkeypatch.context() as patch:
        patch.setattr(files, "write_bytes", watched)
        assert evolve(["ga", *SHORT, "--output", "whole"]) == 0
    assert [name for name, _ in moments] == [
        "config.yaml",
        "provenance.json",
        *["checkpoint.npz", "history.csv", "best_individuals.npz", "timing.csv"] * 2,
        "champion.json",
        "provenance.json",
    ]
    for _, moment in moments:
        assert evolve(["--resume", moment]) == 0
        assert_reproduced(here / moment, here / "whole")
        assert n_records(here / moment) == 2


def test_a_full_disk_leaves_what_was_there(
    here, no_pictures, every_generation_saved, monkeypatch
):
    argv = ["ga", *TINY, "--output"]
    assert evolve([*argv, "whole"]) == 0
    sync, calls = os.fsync, []

    def full(handle: int) -> None:
        calls.append(handle)
        # config, provenance, checkpoint and what follows, and then another checkpoint
        if len(calls) == 7:
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(handle)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(UserError, match=r"No space left .* --resume run$"):
            evolve([*argv, "run"])
    names = {"config.yaml", "provenance.json", "checkpoint.npz", "history.csv"}
    names |= {"best_individuals.npz", "timing.csv", LOCK}
    assert {path.name for path in (here / "run").iterdir()} == names
    assert (n_records(here / "run"), n_rows(here / "run")) == (1, 1)
    assert evolve(["--resume", "run"]) == 0
    assert_reproduced(here / "run", here / "whole")


def test_a_run_that_has_only_its_config_can_be_resumed(here, no_pictures):
    argv = ["ga", *SHORT]
    assert evolve([*argv, "--output", "whole"]) == 0
    (here / "begun").mkdir()
    shutil.copy("whole/config.yaml", "begun")
    assert evolve(["--resume", "begun"]) == 0
    assert_reproduced(here / "begun", here / "whole")
    provenance = json.loads((here / "begun" / "provenance.json").read_text())
    assert provenance["finished"]


def test_resume_from_another_directory(unfinished, finished, no_pictures, monkeypatch):
    elsewhere = unfinished.parent / "else" / "where"
    elsewhere.mkdir(parents=True)
    monkeypatch.chdir(elsewhere)
    assert evolve(["--resume", "../../run"]) == 0
    assert not any(elsewhere.iterdir())
    assert json.loads((unfinished / "provenance.json").read_text())["finished"]
    history = (unfinished / "history.csv").read_bytes()
    assert history == (finished[0] / "history.csv").read_bytes()


class InterruptedAgain(Progress):
    """Ctrl-C in the first generation, and once more while that unwinds."""

    def update(self, record: Record) -> None:
        signal.raise_signal(signal.SIGINT)

    def close(self) -> None:
        super().close()
        signal.raise_signal(signal.SIGINT)


def test_a_second_and_a_third_ctrl_c_change_nothing(here, handlers, monkeypatch, capfd):
    monkeypatch.setattr(run_command, "Progress", InterruptedAgain)
    try:
        assert evolve(["ga", *TINY, "--output", "run"]) == 130
        # and on the way to the end of the process
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        pytest.fail("interrupted again")
    assert resume_command(capfd.readouterr().err) == ["--resume", "run"]
    assert n_records(here / "run") == 1


def test_an_arena_that_the_wheeled_robot_cannot_use_is_refused_first(refusal, here):
    (here / "mine.xml").write_text(re.sub('<geom type="plane".*?/>', "", arena()))
    message = refusal("ga", *TINY, "--arena", "mine.xml", "--output", "out")
    assert "no floor for the robot's wheels" in message


def test_an_arena_that_the_kinematic_robot_cannot_use_is_refused_first(
    refusal, here, no_pictures, capfd
):
    leaning = '<geom name="mast" type="cylinder" size=".02 .1" euler="20 0 0"/>'
    text = (MODELS / "arena.xml").read_text()
    (here / "mine.xml").write_text(
        text.replace("</worldbody>", f"{leaning}</worldbody>")
    )
    argv = ["ga", *SHORT, "--arena", "mine.xml", "--output", "out"]
    message = refusal(*argv)
    assert "geom 'mast' has no exact outline in a plan: " in message
    assert message.endswith("; --robot epuck simulates it")
    assert not (here / "out").exists()
    assert evolve([*argv, "--robot", "epuck"]) == 0
    assert capfd.readouterr().err.count("not tested on epuck_kinematic: ") == 1
    assert list(load_controller("out/champion.json").scores["held_out"]) == ["epuck"]


def test_a_checkpoint_of_another_seed_is_refused(
    refusal, unfinished, no_pictures, capfd
):
    assert evolve(["ga", *TINY, "--seed", "8", "--output", "other"]) == 0
    capfd.readouterr()
    shutil.copy("other/checkpoint.npz", "run")
    refusal("--resume", "run")


def test_a_robot_changed_since_is_refused_on_resume(refusal, here, no_pictures, capfd):
    (here / "mine.xml").write_text(FULL)
    argv = ["ga", *SHORT, "--robot", "mine.xml"]
    assert evolve([*argv, "--evaluations", "10", "--output", "run"]) == 0
    stored = json.loads((here / "run" / "provenance.json").read_text())
    (here / "run" / "provenance.json").write_text(
        json.dumps({**stored, "finished": None})
    )
    (here / "mine.xml").write_text(FULL.replace("kv=", "kv=  "))
    capfd.readouterr()
    assert " has been edited since: robot (see " in refusal("--resume", "run")


def test_a_run_on_an_own_robot_can_be_resumed_from_elsewhere(
    here, no_pictures, monkeypatch
):
    (here / "mine.xml").write_text(FULL)
    assert evolve(["ga", *SHORT, "--robot", "mine.xml", "--output", "run"]) == 0
    (here / "run" / "provenance.json").unlink()
    (here / "else").mkdir()
    monkeypatch.chdir(here / "else")
    assert evolve(["--resume", "../run"]) == 0


def test_a_run_killed_while_it_wrote_its_config_can_be_started_again(here, no_pictures):
    (here / "run").mkdir()
    (here / "run" / ".config.yaml-b2q7x_1c.tmp").write_text("seed: 7")
    assert evolve(["ga", *SHORT, "--output", "run"]) == 0


def test_leftovers_of_a_kill_are_not_shown(unfinished, no_pictures, capsys):
    (unfinished / ".checkpoint.npz-b2q7x_1c.tmp").write_bytes(b"PK")
    assert evolve(["--resume", "run"]) == 0
    assert "b2q7x_1c.tmp" not in capsys.readouterr().out


@pytest.mark.parametrize("content", ["", "{", "[1]", '{"resumed": 3}'])
def test_a_damaged_provenance_is_refused(content, refusal, unfinished):
    (unfinished / "provenance.json").write_text(content)
    assert "run/provenance.json" in refusal("--resume", "run")


@pytest.mark.parametrize("name", ["history.csv", "champion.json"])
def test_what_cannot_be_written_later_is_a_user_error(name, unfinished, no_pictures):
    (unfinished / name).unlink(missing_ok=True)
    (unfinished / name).mkdir()
    with pytest.raises(UserError, match=name):
        evolve(["--resume", "run"])


@pytest.mark.parametrize("flag", ["", "--robot", "--output"])
def test_a_name_too_long_for_a_file_is_refused(flag, refusal):
    name = 300 * "a"
    refusal(*(["ga", *TINY, flag, name] if flag else [name]))


@pytest.mark.parametrize(
    "argv",
    [
        ["de-best", "--weight-bound", "1e308", "--weight-init", "1e308"],
        ["ga", *TINY, "--threads", "100000000000000"],
    ],
)
def test_a_number_out_of_all_proportion_is_refused(argv, refusal):
    refusal(*argv, "--output", "out")


@pytest.mark.parametrize(("offset", "bit"), [(10, 0), (8, 0)])
def test_a_flipped_bit_in_the_checkpoints_directory_is_refused(
    offset, bit, refusal, unfinished
):
    path = unfinished / "checkpoint.npz"
    content = bytearray(path.read_bytes())
    # method of compression and flags of the first entry
    content[content.index(b"PK\x01\x02") + offset] ^= 1 << bit
    path.write_bytes(content)
    assert "run/checkpoint.npz" in refusal("--resume", "run")
