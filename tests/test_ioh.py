"""The IOHprofiler export, read as its readers do: strictly, and by the run."""

import json
from pathlib import Path

import numpy as np
import pytest

from evolution.report.ioh import (
    FUNCTION,
    HEADER,
    LOWEST,
    export_histories,
    improvements,
)
from evolution.study.data import load_study
from tests.finished_runs import finished_run
from tests.study_on_disk import LEVELS, history, write_study

SEEDS = {"de-best": [1, 2, 7], "ga": [3], "de-rand": []}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    place = tmp_path_factory.mktemp("ioh")
    data = load_study(write_study(place / "study", SEEDS))
    export_histories(data, place / "ioh")
    return data, place / "ioh"


def read_meta(folder: Path) -> dict:
    """The only JSON file of an algorithm, with the keys that readers ask for."""
    (path,) = folder.rglob("*.json")
    assert path == folder / f"IOHprofiler_f1_{FUNCTION}.json"
    meta = json.loads(path.read_text(), parse_constant=pytest.fail)
    # as the package ioh 0.3.22 writes them, in its order
    assert list(meta) == [
        "version",
        "suite",
        "function_id",
        "function_name",
        "maximization",
        "algorithm",
        "attributes",
        "scenarios",
    ]
    assert list(meta["algorithm"]) == ["name", "info"]
    for scenario in meta["scenarios"]:
        assert list(scenario) == ["dimension", "path", "runs"]
        for run in scenario["runs"]:
            assert list(run) == ["instance", "evals", "best"]
            assert list(run["best"]) == ["evals", "y", "x"]
    return meta


def read_data(path: Path) -> list[np.ndarray]:
    """Rows `(n, 2)` of each run: a header line begins it, as in IOHanalyzer."""
    runs: list[list[list[str]]] = []
    for line in path.read_text().splitlines():
        cells = line.split(" ")
        assert len(cells) == len(HEADER)
        if cells == list(HEADER):
            runs.append([])
        else:
            runs[-1].append(cells)
    return [np.array(rows, float) for rows in runs]


def test_a_folder_per_experiment_with_runs(exported):
    _, folder = exported
    assert {path.name for path in folder.iterdir()} == {"README.md", "de-best", "ga"}
    # either would be taken for data in another format
    assert not [*folder.rglob("*.txt"), *folder.rglob("*.csv"), *folder.rglob("*.info")]


@pytest.mark.parametrize("name", ["de-best", "ga"])
def test_every_run_reads_back(exported, name):
    data, folder = exported
    meta = read_meta(folder / name)
    assert (meta["maximization"], meta["attributes"]) == (True, list(HEADER))
    assert meta["algorithm"]["name"] == name
    (scenario,) = meta["scenarios"]
    assert scenario["dimension"] == 40
    assert scenario["path"] == "data_f1_WallFollowing/IOHprofiler_f1_DIM40.dat"
    assert [run["instance"] for run in scenario["runs"]] == SEEDS[name]
    curves = read_data(folder / name / scenario["path"])
    for run, curve, stored in zip(
        scenario["runs"], curves, data.runs[name], strict=True
    ):
        evaluations, best = curve.T
        assert (np.diff(evaluations) > 0).all()
        # only the last row may stand still
        assert (np.diff(best)[:-1] > 0).all()
        # iohinspector tells runs apart by this
        assert np.flatnonzero(evaluations == 1).tolist() == [0]
        assert best[0] == LOWEST
        # exactly the best so far, at the end of every generation
        rows = history(name, stored.seed)
        so_far = np.maximum.accumulate(rows[:, 2])
        at = np.searchsorted(evaluations, rows[:, 1], side="right") - 1
        assert (best[at] == so_far).all()
        assert run["evals"] == evaluations[-1] == rows[-1, 1]
        assert run["best"]["y"] == so_far[-1]
        assert run["best"]["evals"] == rows[so_far.argmax(), 1]


def a_run(evaluations, best):
    columns = {
        "evaluations": np.array(evaluations, float),
        "best": np.array(best, float),
    }
    return finished_run(1, columns)


@pytest.mark.parametrize(
    ("evaluations", "best", "expected"),
    [
        ([10, 20, 30], [5, 3, 6], [(1, 0.0), (10, 5.0), (30, 6.0)]),
        ([10, 20], [5, 5], [(1, 0.0), (10, 5.0), (20, 5.0)]),
        ([1, 2], [5, 7], [(1, 5.0), (2, 7.0)]),
        ([10, 20], [0, 4], [(1, 0.0), (20, 4.0)]),
        ([10], [0], [(1, 0.0), (10, 0.0)]),
    ],
)
def test_improvements_by_hand(evaluations, best, expected):
    assert improvements(a_run(evaluations, best)) == expected


def test_the_note_says_what_the_numbers_are(exported):
    _, folder = exported
    text = (folder / "README.md").read_text()
    for word in ("stored", "generation", "evaluation 1", "empty"):
        assert word in text
    assert set(LEVELS) >= set(SEEDS)
