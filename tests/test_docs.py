"""What the documents say works: their code is run as a reader would run it."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import PATIENCE

ROOT = Path(__file__).resolve().parent.parent
OPTIMIZERS = (ROOT / "docs" / "optimizers.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", OPTIMIZERS, re.M | re.S)


def python(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", *words],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


def test_fitness_in_a_script():
    script, _ = blocks("python")
    # fewer individuals of a generation
    assert script.count("size=(20,") == 1
    script = script.replace("size=(20,", "size=(4,")
    done = python("-c", script, cwd=ROOT)
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert len(lines) == 3
    assert all(re.match(r"best of 300: \d+\.\d, mean \d+\.\d$", x) for x in lines)


@pytest.fixture(scope="module")
def extended(tmp_path_factory) -> Path:
    """The packages, with the optimiser of the document."""
    folder = tmp_path_factory.mktemp("extended")
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("epuck_mj", "evolution", "models", "tests"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    search = folder / "evolution" / "search"
    (search / "particle_swarm.py").write_text(blocks("python")[1])
    path = search / "table.py"
    text = path.read_text()
    (patch,) = blocks("diff")
    for hunk in patch.strip("\n").split("\n\n"):
        after = [line[1:] for line in hunk.splitlines()]
        before = [line[1:] for line in hunk.splitlines() if line[0] == " "]
        assert text.count("\n".join(before)) == 1
        text = text.replace("\n".join(before), "\n".join(after))
    path.write_text(text)
    config, study = blocks("yaml")
    (folder / "evolution" / "configs" / "particle-swarm.yaml").write_text(config)
    (folder / "mine.yaml").write_text(study)
    return folder


@pytest.mark.slow
def test_an_optimiser_of_ones_own_is_as_good_as_the_shipped_ones(extended):
    path = extended / "tests" / "test_optimizer.py"
    first = '    "de-best reevaluated":'
    text = path.read_text()
    assert text.count(first) == 1
    line = '    "particle-swarm": ALGORITHMS["particle_swarm"](),\n'
    path.write_text(text.replace(first, line + first))
    chosen = ["-k", "particle-swarm", "tests/test_optimizer.py"]
    done = python("-m", "pytest", "-q", "-p", "no:cacheprovider", *chosen, cwd=extended)
    assert done.returncode == 0, done.stdout
    assert re.search(r"[1-9]\d passed", done.stdout)


# what its commands do, in one process
IN_A_STUDY = """
from pathlib import Path
from evolution.run import results
from evolution.run.__main__ import evolve
from evolution.study.config import StudyConfig

results._draw_fitness = results._show = lambda *_: None
small = "--evaluations 120 --steps 10 --trials 2 --validation-starts 5"
run = ["particle-swarm", *small.split(), "--test-starts", "5", "--output"]
assert evolve([*run, "runs/one"]) == 0
assert evolve([*run, "runs/all-live", "--no-racing"]) == 0
print(*StudyConfig.load(Path("mine.yaml")).experiments)
"""


@pytest.mark.slow
def test_an_optimiser_of_ones_own_in_a_study(extended):
    done = python("-c", IN_A_STUDY, cwd=extended)
    assert done.returncode == 0, done.stderr
    line = "particle-swarm, seed 1: 120 evaluations in 3 generations"
    assert done.stdout.count(line) == 2
    assert done.stdout.splitlines()[-1] == "de-best ga particle-swarm"
    one, other = (
        (extended / "runs" / name / "history.csv").read_bytes()
        for name in ("one", "all-live")
    )
    assert one == other
