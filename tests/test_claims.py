"""The paper's claims against hand-made studies: each verdict, and how it falls."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from evolution.config import find_config, load_config
from evolution.report.claims import (
    CONSISTENT,
    INCONSISTENT,
    UNTESTED,
    Claim,
    claims,
    held_out_order,
    maturity,
    mean_to_best,
    verdicts,
)
from evolution.report.first_generation import FirstGeneration, first_generation
from evolution.report.reproduction import reproduction
from evolution.study_data import RunData, StudyData

NAMES = ("de-best", "de-rand", "ga")


UNEVOLVED = [FirstGeneration("literal", 150, 249.0, 248.0, {"circler": 1.0})]


def run(seed: int, best: float, mean: float, held_out: float, follows: float = 1.0):
    """A run whose best rises in a straight line up to `best`."""
    evaluations = np.arange(1, 11) * 100.0
    tests = {
        robot: {
            "mean": held_out,
            "crash_rate": 1 - follows,
            "behaviour": {"crashed": 1 - follows, "hugger": follows},
        }
        for robot in ("epuck_planar", "epuck")
    }
    scores = {
        "stored": best,
        "held_out": tests,
        "most_believed": {"stored": best, "held_out": held_out - 100},
    }
    return RunData(
        seed=seed,
        history={
            "generation": np.arange(10.0),
            "evaluations": evaluations,
            "best": best * evaluations / 1000,
            "mean": mean * evaluations / 1000,
            "std": np.ones(10),
        },
        champion=SimpleNamespace(scores=scores),  # type: ignore[arg-type]
        path=Path(f"seed-{seed}"),
    )


def study(best: dict[str, float], mean=None, n: int = 5, **changes) -> StudyData:
    """Runs whose best fitness is spread by a few units around `best`."""
    mean = mean or {name: 0.9 for name in NAMES}
    runs = {
        name: tuple(
            run(seed, value + seed, mean[name] * value, value) for seed in range(n)
        )
        for name, value in best.items()
    }
    fields = {
        "path": Path("paper"),
        "configs": {name: load_config(find_config(name)) for name in NAMES},
        "runs": {name: () for name in NAMES} | runs,
        "robots": ("epuck_planar", "epuck"),
        "steps": 300,
        "yardstick": {},
        "missing": (),
    }
    return StudyData(**(fields | changes))


def verdict(found: list[Claim], *words: str) -> str:
    (claim,) = [c for c in found if all(word in c.text for word in words)]
    return claim.verdict


LIKE_THE_PAPER = {"de-best": 245.0, "de-rand": 213.0, "ga": 201.0}


def test_a_study_like_the_paper_is_consistent_with_its_order_and_maxima():
    found = claims(study(LIKE_THE_PAPER))
    for better, worse in (("DE/best", "DE/rand"), ("DE/rand", "GA"), ("DE/best", "GA")):
        assert verdict(found, f"{better}", "beats", worse) == CONSISTENT
    for maximum in ("246.66", "215.217", "202.775"):
        assert verdict(found, maximum) == CONSISTENT


def test_the_opposite_order_is_inconsistent():
    found = claims(study({"de-best": 100.0, "de-rand": 200.0, "ga": 250.0}))
    assert verdict(found, "DE/best", "beats", "DE/rand") == INCONSISTENT
    assert verdict(found, "DE/rand", "beats", "GA") == INCONSISTENT
    # five runs do not say how far a sixth may lie
    assert verdict(found, "246.66") == UNTESTED
    found = claims(study({"de-best": 100.0}, n=20))
    assert verdict(found, "246.66") == INCONSISTENT


def test_three_runs_decide_no_order():
    found = claims(study(LIKE_THE_PAPER, n=3))
    assert verdict(found, "DE/best", "beats", "GA") == UNTESTED
    assert "p = 0.100" in found[0].ours


def test_another_budget_or_task_tests_nothing():
    data = study(LIKE_THE_PAPER)
    config = data.configs["ga"].model_copy(update={"evaluations": 1500})
    found = claims(replace(data, configs={**data.configs, "ga": config}))
    assert {claim.verdict for claim in found} == {UNTESTED}
    assert found[0].ours == "needs evaluations 30000, the study has 1500"


def test_equal_algorithms_cannot_be_told_apart():
    found = claims(study(dict.fromkeys(NAMES, 200.0)))
    assert verdict(found, "DE/best", "beats", "GA") == UNTESTED


@pytest.mark.parametrize("n", [1, 2])
def test_fewer_runs_than_the_papers_test_nothing(n):
    assert {claim.verdict for claim in claims(study(LIKE_THE_PAPER, n=n))} == {UNTESTED}


def test_an_algorithm_without_runs_leaves_its_claims_open():
    found = claims(study({"de-best": 245.0, "ga": 201.0}))
    assert verdict(found, "DE/best", "beats", "DE/rand") == UNTESTED
    assert verdict(found, "DE/best", "beats", "GA") == CONSISTENT


def test_mean_and_best():
    near = {"de-best": 0.95, "de-rand": 0.9, "ga": 0.4}
    found = claims(study(LIKE_THE_PAPER, near))
    assert verdict(found, "DE/best", "approaches its best") == CONSISTENT
    assert verdict(found, "stays far from its best") == CONSISTENT
    far = {"de-best": 0.3, "de-rand": 0.9, "ga": 0.8}
    found = claims(study(LIKE_THE_PAPER, far))
    assert verdict(found, "DE/best", "approaches its best") == INCONSISTENT
    assert verdict(found, "stays far from its best") == INCONSISTENT


def test_quantities_by_hand():
    data = study({"de-best": 200.0}, n=3)
    # best 200, 201, 202; mean 180 in all
    np.testing.assert_allclose(
        mean_to_best(data, "de-best"), [180 / 200, 180 / 201, 180 / 202]
    )
    # 90 % of a straight line is there after nine tenths
    np.testing.assert_allclose(maturity(data, "de-best"), [0.9, 0.9, 0.9])
    assert verdict(claims(data), "DE/best", "mature") == UNTESTED
    late = study({"de-best": 200.0}, n=5)
    assert verdict(claims(late), "DE/best", "mature") == INCONSISTENT


def test_behaviour_is_judged_on_the_last_robot():
    data = study(LIKE_THE_PAPER)
    assert verdict(claims(data), "DE/best", "without crashing") == CONSISTENT
    crashing = tuple(run(seed, 245, 200, 245, follows=0.5) for seed in range(5))
    data = replace(data, runs={**data.runs, "de-best": crashing})
    assert verdict(claims(data), "DE/best", "without crashing") == INCONSISTENT
    assert verdict(claims(data), "GA", "without crashing") == CONSISTENT


def test_the_held_out_order_is_another_one():
    data = study(LIKE_THE_PAPER)
    lucky = tuple(run(seed, 245 + seed, 200, 100 + seed) for seed in range(5))
    data = replace(data, runs={**data.runs, "de-best": lucky})
    assert verdict(claims(data), "DE/best", "beats", "GA") == CONSISTENT
    for robot in data.robots:
        found = held_out_order(data, robot)
        assert verdict(found, "DE/best", "beats", "GA") == INCONSISTENT


def test_verdicts_are_counted():
    counts = verdicts(claims(study(LIKE_THE_PAPER)))
    assert sum(counts.values()) == len(claims(study(LIKE_THE_PAPER)))


def test_reproduction_says_everything_once():
    data = study(
        LIKE_THE_PAPER,
        missing=("ga: no finished run of seed 9",),
        yardstick={"epuck_planar": {"mean": 195.8}, "epuck": {"mean": 196.9}},
    )
    text = reproduction(data, None, UNEVOLVED, "python -m evolution.reproduce --quick")
    assert text == reproduction(
        data, None, UNEVOLVED, "python -m evolution.reproduce --quick"
    )
    assert "python -m evolution.reproduce --quick" in text
    assert "ga: no finished run of seed 9" in text
    assert "| literal | 150 | 249.0 | 248.0 | circler 100% |" in text
    assert "| wall-follower, written by hand |  |  | 196.9 | 195.8 |  |" in text
    # the most believed is worth 100 less than the champion
    assert "| DE/best/1/bin | 5 | 247.0 [246.0, 248.0] | 145.0 [145.0, 145.0] |" in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert all(line.endswith("|") for line in tables)
    for heading in ("claims", "stored fitness hides", "differs from the original"):
        assert sum(heading in line for line in text.splitlines() if line[0:1] == "#")


def test_reproduction_of_a_single_run():
    data = study({"de-best": 200.0}, n=1, robots=("epuck",))
    text = reproduction(data, data, UNEVOLVED, "command")
    assert "can't be tested" in text
    assert "Evolved on wheels from the start" in text


def test_the_printed_equation_leaves_nothing_to_evolve():
    config = load_config(find_config("de-best"))
    config = config.model_copy(update={"steps": 150})
    found = {name: first_generation(config, name) for name in ("literal", "product")}
    assert found["literal"].individuals == 150
    assert found["literal"].best > 0.75 * 150
    assert found["product"].best < 0.2 * 150
    near_walls = ("wall follower", "hugger")
    assert sum(found["literal"].behaviour[name] for name in near_walls) < 0.05
