"""Thinned histories: what a study asks of them is what all generations would say."""

import numpy as np
import pyarrow as pa
import pytest

from evolution.statistics.targets import evaluations_to_target
from evolution.study.histories import SCHEMA, histories_in, history_table
from evolution.study.thinning import MOST, thinned

ELITIST, FORGETFUL, CLIMBED, SHORT = "elitist", "forgetful", "climbed", "short"
GENERATIONS = {ELITIST: 3000, FORGETFUL: 1000, CLIMBED: 250, SHORT: 7}
RUNS = [(name, seed) for name in GENERATIONS for seed in (1, 2)]


def history(name: str, seed: int) -> dict[str, np.ndarray]:
    """A run of which the fitness rises, for some only now and then."""
    n, rng = GENERATIONS[name], np.random.default_rng([seed, len(name)])
    best = 300 * np.linspace(0, 1, n) ** 0.3 + rng.normal(0, 20, n)
    robots = np.full(n, "epuck_kinematic")
    if name == ELITIST:
        best = np.maximum.accumulate(best)
    if name == CLIMBED:
        robots[n * 9 // 10 :] = "epuck"
        best[n * 9 // 10 :] -= 100
    return {
        "generation": np.arange(n),
        "evaluations": 10 * np.arange(1, n + 1),
        "best": best,
        "mean": best - rng.random(n),
        "std": rng.random(n),
        "robot": robots,
        "control_steps": rng.integers(1, 10**6, n).astype(float),
        "crash_rate": rng.integers(0, 51, n) / 50,
    }


@pytest.fixture(scope="module")
def whole() -> pa.Table:
    return history_table({run: history(*run) for run in RUNS})


@pytest.fixture(scope="module")
def few(whole) -> dict:
    return histories_in(thinned(whole))


def test_a_run_has_not_many_rows(few):
    assert list(few) == RUNS
    for (name, _), kept in few.items():
        full = history(name, 1)["best"]
        rises = (np.diff(np.maximum.accumulate(full)) > 0).sum()
        assert len(kept["best"]) <= MOST + 2 * rises + 8
    assert [len(few[SHORT, seed]["best"]) for seed in (1, 2)] == [7, 7]


@pytest.mark.parametrize("run", RUNS, ids=str)
def test_rows_that_stay_are_those_of_the_run(run, few):
    full, kept = history(*run), few[run]
    these = kept["generation"].astype(int)
    for name in ("evaluations", "best", "mean", "std", "robot", "crash_rate"):
        assert np.array_equal(kept[name], full[name][these])
    last = len(full["best"]) - 1
    assert {0, 1, last - 1, last} <= set(these.tolist())
    assert np.diff(these).max() <= -(-(last + 1) // MOST)
    # where it climbed, both sides
    changes = np.flatnonzero(full["robot"][1:] != full["robot"][:-1])
    assert {*changes, *(changes + 1)} <= set(these.tolist())


@pytest.mark.parametrize("run", RUNS, ids=str)
def test_evaluations_to_any_target_are_the_same(run, few):
    full, kept = history(*run), few[run]
    for target in np.linspace(1, 310, 60):
        expected, got = (
            evaluations_to_target(each["evaluations"], each["best"], target)
            for each in (full, kept)
        )
        assert np.array_equal(got, expected, equal_nan=True)


@pytest.mark.parametrize("run", RUNS, ids=str)
def test_control_steps_are_summed_since_the_row_before(run, few):
    full, kept = history(*run), few[run]
    total = np.cumsum(full["control_steps"])[kept["generation"].astype(int)]
    assert np.array_equal(np.cumsum(kept["control_steps"]), total)


def test_what_is_thinned_stays_as_it_is(whole):
    once = thinned(whole)
    assert once.schema == SCHEMA
    assert thinned(once).equals(once)
    assert thinned(SCHEMA.empty_table()).equals(SCHEMA.empty_table())


def test_control_steps_that_are_not_known_stay_unknown():
    run = (SHORT, 1)
    unknown = history(*run) | {"control_steps": np.full(7, np.nan)}
    assert thinned(history_table({run: unknown}))["control_steps"].null_count == 7
    long = history(ELITIST, 1)
    long["control_steps"][100:] = np.nan
    kept = histories_in(thinned(history_table({(ELITIST, 1): long})))[ELITIST, 1]
    assert np.nansum(kept["control_steps"]) == long["control_steps"][:100].sum()
