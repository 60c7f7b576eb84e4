"""The page about evolution that learns: who is held against whom, and figures."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.errors import UserError
from evolution.hybrids.__main__ import report_hybrids
from evolution.hybrids.compared import (
    against_base,
    against_control,
    crash_rates,
    median_with_never,
    sweep,
    trials_to_useful,
)
from evolution.judging.scores import HeldOut, Scores
from evolution.pages.words import label
from evolution.search.lifetime_learning import LifetimeLearningParameters
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.statistics.significance import holm, mann_whitney
from evolution.study.config import StudyConfig, find_study
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun
from tests.finished_runs import finished_run

N = 12


def run(seed: int, held_out: float, trials: int) -> FinishedRun:
    tests = {
        robot: HeldOut(mean=held_out, crash_rate=seed / 100, starts=200)
        for robot in ("epuck", "epuck_kinematic")
    }
    # useful after as many trials for everybody, but for the first run
    best = [50.0, 150.0 if seed == 0 else 210.0]
    spent = np.array([1000.0, 60_000 / trials])
    return finished_run(
        seed,
        {"evaluations": spent, "best": np.array(best)},
        Scores(stored=held_out, held_out=tests),
    )


def study(fitness: dict[str, float]) -> StudyData:
    configs = StudyConfig.load(find_study("hybrids")).experiments
    return StudyData(
        path=Path("hybrids"),
        configs={name: configs[name] for name in fitness},
        runs={
            name: tuple(
                run(seed, each + seed, configs[name].trials) for seed in range(N)
            )
            for name, each in fitness.items()
        },
        robots=("epuck", "epuck_kinematic"),
        steps=300,
        yardstick={},
        missing=(),
    )


FITNESS = {
    "de-best": 215.0,
    "memetic-de": 215.0,
    "imitators-then-cma-es": 235.0,
    "policy-gradient-in-life": 190.0,
    "imitation": 230.0,
    "perturbation": 200.0,
    "imitation-baldwinian": 210.0,
    "perturbation-baldwinian": 205.0,
    "imitation-10": 220.0,
    "perturbation-60": 20.0,
}


def test_hybrids_are_held_against_de_best_in_one_family():
    data = study(FITNESS)
    found = {each.name: each for each in against_base(data)}
    # what varies the share of the budget is in no family
    assert set(found) == set(FITNESS) - {"de-best", "imitation-10", "perturbation-60"}
    base = data.held_out("de-best", "epuck")
    raw = [mann_whitney(data.held_out(name, "epuck"), base).p for name in found]
    adjusted = holm(np.array(raw))
    assert [each.p for each in found.values()] == pytest.approx(adjusted)
    verdicts = {name: each.verdict for name, each in found.items()}
    assert verdicts["imitators-then-cma-es"] == "better"
    assert verdicts["policy-gradient-in-life"] == "worse"
    assert verdicts["memetic-de"] == "equivalent"
    assert found["imitation"].shift.shift == 15.0


def test_rules_are_held_against_perturbation_of_their_inheritance():
    pairs = [(each.name, each.other) for each in against_control(study(FITNESS))]
    assert pairs == [
        ("policy-gradient-in-life", "perturbation"),
        ("imitation", "perturbation"),
        ("imitation-baldwinian", "perturbation-baldwinian"),
    ]


def test_few_runs_have_no_verdict():
    data = study(FITNESS)
    few = replace(data, runs={name: each[:9] for name, each in data.runs.items()})
    assert {each.verdict for each in against_base(few)} == {"too few runs"}


def test_the_sweep_begins_without_lessons():
    found = sweep(study(FITNESS))
    assert {rule: list(each) for rule, each in found.items()} == {
        "policy_gradient": [0.0, 0.3],
        "imitation": [0.0, 0.1, 0.3],
        "perturbation": [0.0, 0.3, 0.6],
    }
    assert found["perturbation"][0.6].min() == 20.0


def test_targets_are_counted_in_trials():
    data = study(FITNESS)
    for name in ("de-best", "imitators-then-cma-es"):
        trials = trials_to_useful(data, name)
        assert math.isnan(trials[0])
        np.testing.assert_allclose(trials[1:], 60_000)
        assert median_with_never(trials) == 60_000
    assert median_with_never(np.array([np.nan, np.nan, 1.0])) == math.inf
    assert crash_rates(data, "de-best").tolist() == [seed / 100 for seed in range(N)]


def test_the_page_shows_every_experiment(tmp_path, monkeypatch):
    monkeypatch.setattr("evolution.study.data.load_study", lambda _: study(FITNESS))
    assert report_hybrids(["x", "--output", str(tmp_path)]) == 0
    text = (tmp_path / "hybrids.md").read_text()
    assert "10 experiments of 150,000 trials" in text and "120 runs" in text
    # no study of a test has margins
    assert "How close to the edge" not in text
    for name in FITNESS:
        assert f"| {label(study(FITNESS), name)} | 12 |" in text
    for form in ("svg", "pdf", "png"):
        for figure in ("worth", "sweep"):
            assert (tmp_path / "figures" / f"{figure}.{form}").stat().st_size > 1000
    assert "<h1" in (tmp_path / "hybrids.html").read_text()


def test_without_de_best_there_is_no_page(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "evolution.study.data.load_study", lambda _: study({"imitation": 200.0})
    )
    with pytest.raises(UserError, match=r"expected runs of 'de-best'.*got imitation"):
        report_hybrids(["x", "--output", str(tmp_path)])


def test_the_share_that_is_not_varied_is_the_shipped_one():
    config: ExperimentConfig = load_config(find_config("lifetime-learning"))
    assert isinstance(config.optimizer, LifetimeLearningParameters)
    shipped = config.optimizer.learning_share
    assert shipped == LifetimeLearningParameters.learning_share
