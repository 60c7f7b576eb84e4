"""docs/extending.md works: its parts are written, run, resumed, studied and replayed.

As a reader would: from a folder of one's own, with the installed wheel, which is tested
here as well.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.__main__ import COMMANDS as ROBOT_COMMANDS
from epuck_mj.errors import UserError
from epuck_mj.policies.file import load_controller
from epuck_mj.policies.topology import OwnNetwork, check_network
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.fitness import StepFacts, step_fitness
from evolution.__main__ import COMMANDS as EVOLUTION_COMMANDS
from evolution.run.__main__ import evolve
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import load_config
from tests.no_pictures import draw_nothing
from tests.processes import PATIENCE

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "extending.md").read_text()

SMALL = "--steps 12 --trials 2 --population 10 --evaluations 60"
FEW = "--validation-starts 4 --test-starts 4"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.M | re.S)


AVOIDANCE, MEMORY, CHECK_NETWORK, SWARM, CHECK_OPTIMIZER, SCRIPT = blocks("python")
PARTS = {"avoidance.py": AVOIDANCE, "memory.py": MEMORY, "swarm.py": SWARM}
COMMANDS = [line for block in blocks("sh") for line in block.splitlines()]

DRIVER = """
import json, runpy, sys

def command(line):
    words = line.split()
    assert words[:2] == ["python", "-m"]
    sys.argv = words[2:]
    try:
        runpy.run_module(words[2], run_name="__main__", alter_sys=True)
    except SystemExit as end:
        assert not end.code, (line, end.code)

if __name__ == "__main__":
    import epuck_mj
    print("installed in", epuck_mj.__file__)
    from evolution.run import results

    for i, line in enumerate(json.loads(sys.argv.pop(1))):
        if i == 2:
            # one run is drawn and replayed, the others need not be
            results._draw_fitness = results._show = (
                lambda _, run, *__: [each.write_bytes(b"-") for each in run.pictures]
            )
        if line.startswith("python"):
            command(line)
        else:
            exec(line)
"""
"""Command lines and scripts, one after the other, in one process."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A reader's folder with the page's files."""
    folder = tmp_path_factory.mktemp("reader")
    for name, text in PARTS.items():
        assert f"as\n`{name}`" in PAGE or f"as `{name}`" in PAGE
        (folder / name).write_text(text)
    swarm, mine = blocks("yaml")
    (folder / "swarm.yaml").write_text(swarm)
    small = "evaluations: 150\n  steps: 5\n  trials: 1\n  validation_starts: 2"
    small += "\n  test_starts: 2"
    assert "evaluations: 3000" in mine
    (folder / "mine.yaml").write_text(mine.replace("evaluations: 3000", small))
    (folder / "driver.py").write_text(DRIVER)
    return folder


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """A folder with the packages, installed from the wheel that is built of them."""
    built, installed = (tmp_path_factory.mktemp(name) for name in ("built", "wheel"))
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    quick = ["--no-deps", "--no-index"]
    build = [*pip, "wheel", *quick, "--no-build-isolation", "-w", str(built), str(ROOT)]
    subprocess.run(build, check=True, timeout=PATIENCE)
    (file,) = built.glob("*.whl")
    install = [*pip, "install", *quick, "--target", str(installed), str(file)]
    subprocess.run(install, check=True, timeout=PATIENCE)
    return installed


def small(command: str) -> str:
    """The page's command with a budget that a test can afford."""
    run = command.startswith("python -m evolution.run")
    return f"{command} {SMALL} {FEW}" if run else command


@pytest.mark.slow
def test_the_page_from_another_folder_with_the_wheel(folder, wheel):
    study, report = (line for line in COMMANDS if "mine" in line)
    lines = [small(line) for line in COMMANDS if line not in (study, report)]
    lines += [
        study.replace("1-10", "1 --jobs 1"),
        report,
        CHECK_NETWORK,
        CHECK_OPTIMIZER,
        SCRIPT,
    ]
    done = subprocess.run(
        [sys.executable, "driver.py", json.dumps(lines)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(wheel)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"installed in {wheel}" in done.stdout
    assert "particle-swarm, seed 1: 60 evaluations in 6 generations" in done.stdout
    assert "3 of 3 runs are finished" in done.stdout
    assert len(re.findall(r"^best of 300: \d+\.\d, mean \d", done.stdout, re.M)) == 3
    for name in ("avoid", "memory", "swarm"):
        file = load_controller(folder / "runs" / name / "champion.json")
        assert len(file.origin.own_sha256) == 1
    assert "swarm" in (folder / "report" / "report.md").read_text()


IN_THE_WHEEL = """
import io, json, runpy, sys
from contextlib import redirect_stdout

import epuck_mj
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import MODELS
from evolution.settings.config_files import CONFIGS, load_config, shipped_with
from evolution.study.config import StudyConfig

said = {}
script, *commands = sys.argv[1:]
for command in commands:
    sys.argv = [script, command, "--help"]
    with redirect_stdout(io.StringIO()) as out:
        try:
            runpy.run_path(script, run_name="__main__")
        except SystemExit as end:
            assert not end.code, command
    said[command] = out.getvalue()
arenas = [path.stem for path in MODELS.glob("arenas/*.xml")]
for arena in ["arena", *arenas]:
    load_scene("epuck", arena)
for path in shipped_with("optimizer").values():
    load_config(path)
for path in shipped_with("experiments").values():
    StudyConfig.load(path)
print(json.dumps([epuck_mj.__file__, str(MODELS), str(CONFIGS), len(arenas), said]))
"""
"""All commands by their script, and all that is shipped, in an empty folder."""


def contents(folder: Path, package: str) -> dict[Path, bytes]:
    """What is in the files of a package, by their paths."""
    files = [path for path in (folder / package).rglob("*.*") if path.is_file()]
    return {
        path.relative_to(folder): path.read_bytes()
        for path in files
        if "__pycache__" not in path.parts
    }


@pytest.mark.slow
def test_the_wheel_has_all_that_is_shipped_and_its_commands_work(wheel, tmp_path):
    here = contents(ROOT, "epuck_mj") | contents(ROOT, "evolution")
    for path, content in contents(ROOT, "models").items():
        here["epuck_mj" / path] = content
    there = contents(wheel, "epuck_mj") | contents(wheel, "evolution")
    assert sorted(there.keys() ^ here.keys()) == []
    assert [path for path in there if there[path] != here[path]] == []

    modules = {
        module.rpartition(".")[2]: module
        for module in EVOLUTION_COMMANDS | ROBOT_COMMANDS
    }
    done = subprocess.run(
        [sys.executable, "-c", IN_THE_WHEEL, str(wheel / "bin/epuck-mj"), *modules],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(wheel)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stderr) == (0, "")
    package, models, configs, n_arenas, said = json.loads(done.stdout)
    assert package == str(wheel / "epuck_mj/__init__.py")
    assert models == str(wheel / "epuck_mj/models")
    assert configs == str(wheel / "evolution/configs")
    assert n_arenas == len(list((ROOT / "models/arenas").glob("*.xml")))
    for command, module in modules.items():
        assert f"usage: python -m {module} " in said[command]
    assert not list(tmp_path.iterdir())


@pytest.fixture
def here(folder, tmp_path, monkeypatch) -> Path:
    """Another folder with the parts in it."""
    for name, text in PARTS.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    draw_nothing(monkeypatch)
    return tmp_path


ALL_OWN = (
    "--fitness avoidance.py:avoid --network memory.py:Elman "
    f"--optimizer swarm.py:Swarm {SMALL} {FEW}"
)


def test_own_parts_change_nothing_of_what_changes_nothing(here):
    ways = {
        "batch": "--threads 1",
        "alive": "--no-racing --threads 2",
        "dm_control": "--engine dm_control",
    }
    for name, flags in ways.items():
        argv = f"{ALL_OWN} --robot epuck {flags} --output {name}".split()
        assert evolve(argv) == 0
    for name in ways:
        for file in ("history.csv", "champion.json"):
            expected = (here / "batch" / file).read_bytes()
            assert (here / name / file).read_bytes() == expected
    # the config leads to the same parts from anywhere
    config = load_config(here / "batch" / "config.yaml")
    assert set(config.own_parts) == {
        f"{here}/avoidance.py:avoid",
        f"{here}/memory.py:Elman",
        f"{here}/swarm.py:Swarm",
    }
    assert ExperimentConfig.from_yaml(config.to_yaml(), "text") == config


def test_racing_changes_nothing_where_each_step_costs(here):
    """There an individual that crashes early has the highest fitness."""
    (here / "cost.py").write_text(
        "def cost(step):\n    return -1.0 - 0.0 * step.contact\ncost.maximum = -1.0\n"
    )
    flags = f"--fitness cost.py:cost --steps 60 --trials 2 --population 10 {FEW}"
    for racing in ("racing", "no-racing"):
        argv = f"de-best {flags} --evaluations 80 --output {racing}".split()
        assert evolve(argv + ["--no-racing"] * (racing == "no-racing")) == 0
    one, other = (here / name / "history.csv" for name in ("racing", "no-racing"))
    assert one.read_bytes() == other.read_bytes()


def test_an_edited_part_is_refused_on_resume(here, capsys):
    assert evolve(f"{ALL_OWN} --output run".split()) == 0
    slower = "memory.py:Elman: not compiled, so trials on epuck_kinematic run step"
    assert capsys.readouterr().err.count(slower) == 1
    provenance = here / "run" / "provenance.json"
    unfinished = json.loads(provenance.read_text()) | {"finished": None}
    provenance.write_text(json.dumps(unfinished))
    assert evolve(["--resume", "run"]) == 0
    unfinished["own_sha256"][f"{here}/memory.py:Elman"] = "of before"
    provenance.write_text(json.dumps(unfinished))
    with pytest.raises(UserError, match=r"memory\.py:Elman' has been edited since"):
        evolve(["--resume", "run"])


def test_memories_begin_anew_and_belong_to_one_robot(here):
    own = OwnNetwork("memory.py:Elman")
    rng = np.random.default_rng(0)
    genomes, seen = rng.normal(size=(4, own.n_genes)), rng.random((3, 4, 8))
    crowd = own.decode(genomes).started(4)
    first = [crowd(observation) for observation in seen]
    assert not np.array_equal(crowd(seen[0]), first[0])
    again = crowd.started(4)
    np.testing.assert_array_equal(again(seen[0]), first[0])
    # those who stay keep theirs
    stay = np.array([False, True, False, True])
    np.testing.assert_array_equal(again[stay](seen[1][stay]), first[1][stay])
    # one controller in many robots
    many = own.decode(genomes[1]).started(4)
    np.testing.assert_array_equal(many(seen[0])[1], first[0][1])
    check_network("memory.py:Elman")


def facts(n: int = 3) -> StepFacts:
    return StepFacts(
        action=np.tile([1.0, 0.0], (n, 1)),
        command=np.ones((n, 2)),
        observation=np.ones((n, 8)),
        distance=np.full((n, 8), -1.0),
        contact=np.arange(n) == 0,
        time=0.1,
        poses=lambda: np.zeros((n, 3)),
        clearances=lambda: np.full(n, 0.2),
    )


def test_an_own_fitness_says_what_a_step_is_worth(here):
    fitness = step_fitness("avoidance.py:avoid")
    assert fitness.maximum == 1
    assert fitness(facts()).tolist() == [0, 1, 1]
    assert TaskParameters(fitness="avoidance.py:avoid").step_fitness is not None


BAD = """
import numpy as np
def fails(step): return step.nothing
def flat(step): return 1.0
def much(step): return step.time * np.full(len(step.contact), 30.0)
much.maximum = 1.0
def wordy(step): return 0
wordy.maximum = "much"
number = 3
class Product:
    n_genes, n_state = 16, 0
    def act(self, genomes, observation, state):
        weights = genomes.reshape(*genomes.shape[:-1], 2, 8)
        out = np.tanh(weights @ observation[..., None])[..., 0]
        return np.stack([(out[..., 0] + 1) / 2, out[..., 1]], axis=-1), state
class Loud(Product):
    def act(self, genomes, observation, state):
        return 3 + observation[..., :2], state
class Flat(Product):
    def act(self, genomes, observation, state): return np.zeros(2), state
class Deaf: n_genes, n_state = 16, 0
class Countless(Product): n_genes = "many"
class Needy:
    def __init__(self, size): pass
"""


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ("--fitness nowhere.py:f", "cannot read '.*nowhere.py': No such file"),
        ("--fitness no_module_here:f", "cannot import 'no_module_here'"),
        ("--fitness bad.py:other", "no 'other' in '.*bad.py'; available: np, fails, "),
        ("--fitness bad.py:", "expected file.py:name or package.module:name"),
        ("--fitness sum", "expected product, literal, spaced or my.py:name, got 'sum'"),
        ("--fitness bad.py:number", "expected a function, got 3"),
        ("--fitness bad.py:wordy", "expected a number as its maximum, got 'much'"),
        ("--fitness bad.py:fails", "failed in line 3 with AttributeError"),
        ("--fitness bad.py:flat", r"one value a robot, shape \(20,\), got shape \(\)"),
        ("--fitness bad.py:much", "expected at most its maximum, 1, got 3"),
        ("--fitness broken.py:f", "'.*broken.py' failed in line 2 with SyntaxError"),
        ("--fitness late.py:f", "'.*late.py' failed in line 1 with ZeroDivisionError"),
        (
            "--network elman",
            "expected feedforward, feedforward_changes, follower or my.py:name",
        ),
        ("--network bad.py:Loud", "expected v from 0 to 1 and w from -1 to 1, got v 3"),
        ("--network bad.py:Flat", r"expected actions of shape \(20, 2\), got \(2,\)"),
        ("--network bad.py:Deaf", "expected a method 'act'"),
        (
            "--network bad.py:Countless",
            "n_genes: expected a whole number from 1 to 100,000, got",
        ),
        ("--network bad.py:Needy", "failed .*with TypeError"),
        ("--optimizer swarm.py:SwarmParameters", "expected a subclass of evolution"),
        ("--optimizer swarm.py:Swarm --inertai 1", "inertai"),
        ("--optimizer pso", "one of differential_evolution, .* or my.py:Class"),
    ],
)
def test_bad_parts_are_refused_in_one_line(flags, message, here):
    (here / "bad.py").write_text(BAD)
    (here / "broken.py").write_text("import numpy\nf = (\n")
    (here / "late.py").write_text("f = 1 / 0\n")
    argv = f"ga {SMALL} {FEW} --output run {flags}".split()
    with pytest.raises(UserError, match=message) as caught:
        evolve(argv)
    assert "\n" not in str(caught.value)
    assert not (here / "run" / "champion.json").exists()


def test_a_network_that_acts_otherwise_in_a_crowd_is_found(here):
    crowded = "(weights + len(genomes) * 1e-3) @"
    (here / "bad.py").write_text(BAD.replace("weights @", crowded))
    with pytest.raises(UserError, match="acts differently alone and among others"):
        check_network("bad.py:Product")
