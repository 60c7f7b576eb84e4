"""The shipped champions belong to the shipped models and to their own provenance."""

import csv
import hashlib
import json
from pathlib import Path

import pytest

from epuck_mj.controller import load
from epuck_mj.model import MODELS

RUNS = sorted((MODELS.parent / "results" / "default").iterdir())


@pytest.mark.parametrize("run", RUNS, ids=lambda path: path.name)
def test_hashes_are_those_of_the_models_here(run: Path):
    models = {"arena": "arena.xml", "robot": "epuck_planar.xml"}
    expected = {
        part: hashlib.sha256((MODELS / name).read_bytes()).hexdigest()
        for part, name in models.items()
    }
    provenance = json.loads((run / "provenance.json").read_text())
    assert provenance["mjcf_sha256"] == expected
    assert load(run / "champion.json").scene["mjcf_sha256"] == expected
    assert provenance["git"]["modified"] is False
    assert provenance["finished"]


@pytest.mark.parametrize("run", RUNS, ids=lambda path: path.name)
def test_default_experiment_finds_wall_followers(run: Path):
    scores = load(run / "champion.json").scores
    assert scores["held_out"]["epuck"]["mean"] >= 120
    with (run / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[-1]["evaluations"] == "30000"
    assert float(rows[-1]["best"]) >= scores["stored"]
