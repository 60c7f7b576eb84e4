"""docs/recipes.md works: its code runs in order, and its tables name every column.

So does the code of docs/champions.md.
"""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import evolution
from epuck_mj import Trajectory
from evolution.study.data import load_study

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "recipes.md").read_text()
FRAMES, *BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)

WRITTEN = {
    "champions.csv",
    "history.csv",
    "medians.csv",
    "path.csv",
    "path.npz",
    "path.png",
    "signals.png",
}
"""What the page's code writes."""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty folder with the shipped results, in which the code runs."""
    (tmp_path / "results").symlink_to(ROOT / "results")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def section(title: str) -> str:
    """The page's text below a heading, up to the next one."""
    return re.split(r"^#+ ", PAGE.split(f"# {title}\n")[1], maxsplit=1, flags=re.M)[0]


def rows(text: str) -> list[list[str]]:
    """Cells of the tables in a text, without their heads."""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line[2:-2].split(" | ")] for line in lines]
    return [row for row in cells if not row[0].startswith(("question", "column"))]


def test_each_line_gives_what_it_says(folder):
    names: dict = {}
    exec(compile(FRAMES, "recipes.md", "exec"), names)
    lines = {
        question: line.strip("`") for question, line in rows(section("Data frames"))
    }
    found = {question: eval(line, names) for question, line in lines.items()}
    assert len(found) == 15
    for question, answer in found.items():
        assert len(answer), question
        values = answer.reset_index() if isinstance(answer, pd.Series) else answer
        assert not pd.DataFrame(values).isna().all().any(), question

    # against the other reader of the same tables
    study = load_study(Path("results/paper"))
    for name, runs in study.with_runs.items():
        wheels = [run.held_out("epuck") for run in runs]
        assert found["median fitness on wheels"][name] == np.median(wheels)
        assert found["runs of each experiment"][name] == len(runs)
    one = study.runs["ga"][0].history["best"]
    assert found["one run's curve"].tolist() == one.tolist()
    n = sum(map(len, study.runs.values()))
    assert found["all genomes, `(runs, 40)`"].shape == (n, 40)
    shares = found["shares of behaviour classes"].sum(axis=1)
    np.testing.assert_allclose(shares, 1)


def documented(title: str) -> set[str]:
    cells = [row[0] for row in rows(section(title))]
    return {name for cell in cells for name in re.findall(r"`(\w+)`", cell)}


@pytest.mark.parametrize("name", ["paper", "wheels", "transfer"])
def test_the_tables_name_every_column(name):
    study = evolution.load(ROOT / "results" / name)
    # tests of each robot have the same columns
    robots = "^epuck_(kinematic_)?(as_evolved_)?"
    columns = {re.sub(robots, "", each) for each in study.champions.columns}
    assert documented("Columns of `champions`") == columns
    assert documented("Columns of `history`") == set(study.history.columns)


def test_the_code_runs(folder, capsys):
    for block in BLOCKS:
        exec(compile(block, "recipes.md", "exec"), {})
    assert {path.name for path in folder.iterdir()} == WRITTEN | {"results"}
    corridor, classes, real, *crashes = capsys.readouterr().out.splitlines()
    fitness = r"fitness \d+\.\d of 300"
    assert re.fullmatch(rf"{fitness}, \d+% of trials crash", corridor)
    assert re.fullmatch(fitness, real)
    assert sum(eval(classes).values()) == pytest.approx(1)
    # numbers of worlds, and crash rates: weak sensors and late commands are the worst
    worlds = [line.split()[-2:] for line in crashes[2:]]
    assert sum(int(n) for n, _ in worlds) == 100
    assert max(range(len(worlds)), key=lambda i: float(worlds[i][1])) == 1

    path = pd.read_csv("path.csv")
    trajectory = Trajectory.load("path.npz")
    assert path.x_m.tolist() == trajectory.pose[:, 0].tolist()
    medians = pd.read_csv("medians.csv", index_col="experiment")
    champions = evolution.load("results/paper").champions
    assert set(medians.index) == set(champions.experiment)
    assert len(pd.read_csv("champions.csv")) == len(champions)


def test_a_champion_drives_on_where_it_sees_nothing(folder):
    page = (ROOT / "docs" / "champions.md").read_text()
    (block,) = re.findall(r"^```python\n(.*?)^```", page, re.M | re.S)
    names: dict = {}
    exec(compile(block, "champions.md", "exec"), names)
    assert 0.5 < names["v"] <= 1
    assert abs(names["w"]) < 0.5
