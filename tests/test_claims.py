"""The paper's claims against hand-made studies: each verdict, and how it falls."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from evolution.judging.scores import BestStored, HeldOut, Scores
from evolution.report.samples import best_after
from evolution.report.sections.comparisons import comparisons, comparisons_of
from evolution.report.sections.what_was_run import evolved_on
from evolution.reproduce.claim import Claim
from evolution.reproduce.claims import (
    claims,
    held_out_order,
    mean_to_best,
    tally,
    unlike,
)
from evolution.reproduce.first_generation import FirstGeneration, first_generation
from evolution.reproduce.maturity import maturity, spent_until
from evolution.reproduce.reproduction import reproduction
from evolution.reproduce.settled import runs_needed
from evolution.reproduce.verdicts import (
    CONSISTENT,
    INCONSISTENT,
    NOT_CONTRADICTED,
    NOT_MEASURED,
    OTHER_STUDY,
    TOO_FEW,
    UNDECIDED,
    fewest_to_contradict,
    of_best,
    of_most,
)
from evolution.settings.config_files import find_config, load_config
from evolution.statistics.best_of_few import chance_of_best, chance_of_order
from evolution.study.data import StudyData
from tests.finished_runs import finished_run

NAMES = ("de-best", "de-rand", "ga")


UNEVOLVED = [FirstGeneration("literal", 150, 249.0, 248.0, {"circler": 1.0})]


def run(seed: int, best: float, mean: float, held_out: float, follows: float = 1.0):
    """A run whose best rises in a straight line up to `best`."""
    evaluations = np.arange(1, 11) * 100.0
    tests = {
        robot: HeldOut(
            mean=held_out,
            crash_rate=1 - follows,
            starts=1000,
            behaviour={"crashed": 1 - follows, "hugger": follows},
        )
        for robot in ("epuck_kinematic", "epuck")
    }
    scores = Scores(
        stored=best,
        held_out=tests,
        best_stored=BestStored(fitness=best, held_out=held_out - 100),
    )
    return finished_run(
        seed,
        {
            "generation": np.arange(10.0),
            "evaluations": evaluations,
            "best": best * evaluations / 1000,
            "mean": mean * evaluations / 1000,
            "std": np.ones(10),
            "climbed": np.zeros(10),
        },
        scores,
    )


def study(best: dict[str, float], mean=None, n: int = 12, **changes) -> StudyData:
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
        "robots": ("epuck_kinematic", "epuck"),
        "steps": 300,
        "yardstick": {},
        "missing": (),
    }
    return StudyData(**(fields | changes))


def verdict(found: list[Claim], *words: str) -> str:
    (claim,) = [c for c in found if all(word in c.text for word in words)]
    return claim.verdict


LIKE_THE_PAPER = {"de-best": 237.0, "de-rand": 206.0, "ga": 193.0}


def test_a_study_like_the_paper_is_consistent_with_its_order_and_maxima():
    found = claims(study(LIKE_THE_PAPER))
    for better, worse in (("DE/best", "DE/rand"), ("DE/rand", "GA"), ("DE/best", "GA")):
        assert verdict(found, f"{better}", "exceeds", worse, "stored") == CONSISTENT
    for maximum in ("246.66", "215.217", "202.775"):
        assert verdict(found, maximum) == NOT_CONTRADICTED


def test_the_opposite_order_is_inconsistent():
    found = claims(study({"de-best": 100.0, "de-rand": 200.0, "ga": 250.0}))
    assert verdict(found, "DE/best", "exceeds", "DE/rand", "stored") == INCONSISTENT
    assert verdict(found, "DE/rand", "exceeds", "GA", "stored") == INCONSISTENT
    # the best of three runs may well be above twelve others
    assert verdict(found, "246.66") == UNDECIDED
    # and hardly below all of them
    assert verdict(found, "202.775") == INCONSISTENT


@pytest.mark.parametrize("n", [1, 3, 9])
def test_fewer_than_ten_runs_decide_nothing_and_are_shown(n):
    found = claims(study(LIKE_THE_PAPER, n=n))
    assert {claim.verdict for claim in found} == {TOO_FEW}
    assert all(claim.ours != "-" for claim in found)
    if n == 3:
        # of three and three, exact; times the three orders
        assert "p = 0.100, Holm = 0.300" in found[0].ours


def test_orders_are_adjusted_for_their_number():
    """One p of 0.03 among three is no verdict, as in the report."""
    shifts = {"de-best": 3.5, "de-rand": 1.8, "ga": 0.0}
    samples = {name: 200 + shift + np.arange(10) for name, shift in shifts.items()}
    raw = stats.mannwhitneyu(samples["de-best"], samples["ga"]).pvalue
    assert 0.05 / 3 < raw < 0.05
    runs = {
        name: tuple(run(i, value, 1, 200) for i, value in enumerate(sample))
        for name, sample in samples.items()
    }
    found = claims(study({}, runs=runs))
    assert verdict(found, "DE/best", "exceeds", "GA", "stored") == UNDECIDED
    assert not any(
        row.decided for row in comparisons_of(samples, lambda a, b: True, 10)
    )


@pytest.mark.parametrize(
    "changes",
    [{"evaluations": 1500}, {"arena": "corridor"}, {"noise": "strong"}, {"trials": 1}],
    ids=lambda changes: next(iter(changes)),
)
def test_another_budget_or_task_tests_nothing(changes):
    data = study(LIKE_THE_PAPER)
    assert not unlike(data)
    config = data.configs["ga"].model_copy(update=changes)
    data = replace(data, configs={**data.configs, "ga": config})
    for found in (claims(data), held_out_order(data, "epuck")):
        assert {claim.verdict for claim in found} == {OTHER_STUDY}
    (line,) = unlike(data)
    assert line.startswith("ga: ")
    assert next(iter(changes)) in line
    if "noise" in changes:
        assert line in reproduction(data, None, [], "command")


def test_the_robot_and_the_seed_are_free():
    data = study(LIKE_THE_PAPER)
    configs = {
        name: config.model_copy(update={"robot": "epuck", "seed": 7})
        for name, config in data.configs.items()
    }
    assert not unlike(replace(data, configs=configs))


def test_equal_algorithms_cannot_be_told_apart():
    found = claims(study(dict.fromkeys(NAMES, 200.0)))
    assert verdict(found, "DE/best", "exceeds", "GA", "stored") == UNDECIDED


def test_an_algorithm_without_runs_leaves_its_claims_open():
    found = claims(study({"de-best": 245.0, "ga": 201.0}))
    assert verdict(found, "DE/best", "exceeds", "DE/rand", "stored") == TOO_FEW
    assert verdict(found, "DE/best", "exceeds", "GA", "stored") == CONSISTENT


def test_mean_and_best():
    near = {"de-best": 0.95, "de-rand": 0.9, "ga": 0.4}
    found = claims(study(LIKE_THE_PAPER, near))
    assert verdict(found, "DE/best", "approaches its best (lenient") == CONSISTENT
    assert verdict(found, "stays far from its best", "two thirds") == CONSISTENT
    assert verdict(found, "DE/rand", "exceeds", "GA", "mean's share") == CONSISTENT
    far = {"de-best": 0.3, "de-rand": 0.9, "ga": 0.8}
    found = claims(study(LIKE_THE_PAPER, far))
    assert verdict(found, "DE/best", "approaches its best (lenient") == INCONSISTENT
    assert verdict(found, "stays far from its best", "two thirds") == INCONSISTENT
    assert verdict(found, "DE/best", "exceeds", "GA", "mean's share") == INCONSISTENT
    # closer than the GA's, and yet not close
    low = {"de-best": 0.5, "de-rand": 0.5, "ga": 0.2}
    found = claims(study(LIKE_THE_PAPER, low))
    assert verdict(found, "DE/best", "exceeds", "GA", "mean's share") == CONSISTENT
    assert verdict(found, "DE/best", "approaches its best (lenient") == INCONSISTENT


def test_quantities_by_hand():
    data = study({"de-best": 200.0}, n=3)
    # best 200, 201, 202; mean 180 in all
    np.testing.assert_allclose(
        mean_to_best(data, "de-best"), [180 / 200, 180 / 201, 180 / 202]
    )
    # 90 % of a straight line is there after nine tenths
    np.testing.assert_allclose(maturity(data, "de-best"), [0.9, 0.9, 0.9])
    late = study({"de-best": 200.0})
    assert verdict(claims(late), "DE/best", "early (lenient") == INCONSISTENT


@pytest.mark.parametrize(
    ("mature_after", "expected"),
    [(0.3, CONSISTENT), (0.5, CONSISTENT), (0.6, INCONSISTENT)],
)
def test_early_is_read_by_the_own_end(mature_after, expected):
    data = study(LIKE_THE_PAPER)
    for each in data.runs["de-best"]:
        spent = each.history["evaluations"] / 1000
        each.history["best"][:] = np.where(spent >= mature_after, 245.0, 100.0)
    np.testing.assert_allclose(maturity(data, "de-best"), mature_after)
    assert verdict(claims(data), "DE/best", "early (lenient") == expected


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [(0.3, 0.6, CONSISTENT), (0.6, 0.3, INCONSISTENT), (0.5, 0.5, UNDECIDED)],
)
def test_early_is_read_by_a_target_that_is_the_same_for_all(first, second, expected):
    """A run that jumps past the target at once, sooner or later than the GA's."""
    data = study(LIKE_THE_PAPER)
    target = 0.75 * data.steps
    for name, after in {"de-best": first, "ga": second}.items():
        for i, each in enumerate(data.runs[name]):
            spent = each.history["evaluations"] / 1000
            each.history["best"][:] = np.where(spent >= after, target + i, 100.0)
    assert spent_until(data, "de-best", target).tolist() == [first * 1000] * 12
    text = "mature before GA in evaluations until 225"
    assert verdict(claims(data), "DE/best", text) == expected


def test_who_never_reaches_a_target_is_last():
    data = study(LIKE_THE_PAPER | {"ga": 100.0})
    assert (spent_until(data, "ga", 225.0) > 1e8).all()
    text = "mature before GA in evaluations until 225"
    assert verdict(claims(data), "DE/best", text) == CONSISTENT
    (claim,) = [
        each for each in claims(data) if text in each.text and "best" in each.text
    ]
    assert "and never;" in claim.ours


def test_fitness_after_a_budget_is_the_best_so_far():
    data = study(LIKE_THE_PAPER)
    (each, *_) = data.runs["ga"]
    within = each.history["best"][each.history["evaluations"] <= 400]
    assert best_after(data.runs["ga"], 400)[0] == within.max()
    assert best_after(data.runs["ga"], 0)[0] == 0


def test_the_chance_of_an_order_against_drawing():
    rng = np.random.default_rng(0)
    samples = [rng.integers(0, 30, 12) + shift for shift in (4.0, 2.0, 0.0)]
    draws = [rng.choice(sample, (40_000, 3)).max(axis=1) for sample in samples]
    drawn = np.mean((draws[0] > draws[1]) & (draws[1] > draws[2]))
    assert chance_of_order(samples, 3) == pytest.approx(drawn, abs=0.01)
    assert 0.1 < drawn < 0.6
    assert chance_of_order([np.ones(4)] * 3, 3) == 0


def test_the_papers_three_are_tested_together():
    text = "The best of 3 runs each"
    assert verdict(claims(study(LIKE_THE_PAPER)), text) == NOT_CONTRADICTED
    alike = claims(study({"de-best": 245.0, "de-rand": 160.0, "ga": 245.0}))
    assert verdict(alike, text) == INCONSISTENT


def test_the_place_of_the_best_of_three_by_hand():
    ours = np.arange(10.0)
    # below all of ours: of the 286 triples of 13 one
    assert chance_of_best(ours, -1.0, 3) == pytest.approx(2 / 286)
    # above all of ours: any triple with the highest, 66 of 286
    assert chance_of_best(ours, 99.0, 3) == pytest.approx(2 * 66 / 286)
    # the more they have been, the rarer so low, the likelier so high
    assert chance_of_best(ours, -1.0, 4) < chance_of_best(ours, -1.0, 3)
    assert of_best(ours, -1.0, 3)[1] == INCONSISTENT
    assert of_best(ours, 5.5, 3)[1] == NOT_CONTRADICTED
    assert of_best(ours, 99.0, 3)[1] == UNDECIDED
    assert of_best(ours[:9], -1.0, 3)[1] == TOO_FEW


@pytest.mark.parametrize("replicates", [1, 3, 5])
def test_from_how_many_runs_on_a_maximum_can_be_too_high(replicates):
    enough = fewest_to_contradict(replicates)
    assert chance_of_best(np.zeros(enough), 1.0, replicates) < 0.05
    assert chance_of_best(np.zeros(enough - 1), 1.0, replicates) >= 0.05


def test_the_place_of_the_best_of_three_by_simulation():
    """Of runs that are all alike, few are called inconsistent, on either side."""
    rng = np.random.default_rng(0)
    draws = rng.random((4000, 15))
    called = [chance_of_best(row[3:], row[:3].max(), 3) < 0.05 for row in draws]
    assert np.mean(called) <= 0.05
    # and of better ones most
    better = [chance_of_best(row[3:] + 1, row[:3].max(), 3) < 0.05 for row in draws]
    assert np.mean(better) == 1


@pytest.mark.parametrize(
    ("holds", "n", "expected"),
    [
        (9, 10, CONSISTENT),
        (8, 10, UNDECIDED),
        (2, 10, UNDECIDED),
        (1, 10, INCONSISTENT),
        (9, 9, TOO_FEW),
    ],
)
def test_most_runs_are_those_that_wilson_has_on_one_side(holds, n, expected):
    ours, found = of_most(np.arange(n) < holds)
    assert found == expected
    assert ours.startswith(f"{holds} of {n} runs [")


def test_behaviour_is_judged_on_the_last_robot():
    data = study(LIKE_THE_PAPER)
    assert verdict(claims(data), "DE/best", "without crashing (lenient") == CONSISTENT
    crashing = tuple(run(seed, 245, 200, 245, follows=0.5) for seed in range(12))
    data = replace(data, runs={**data.runs, "de-best": crashing})
    assert verdict(claims(data), "DE/best", "without crashing (lenient") == INCONSISTENT
    assert verdict(claims(data), "GA", "without crashing (lenient") == CONSISTENT


def test_runs_without_behaviour_leave_it_open():
    data = study(LIKE_THE_PAPER)
    test = HeldOut(mean=245.0, crash_rate=0.0, starts=1000)
    older = Scores(stored=245.0, held_out={"epuck_kinematic": test, "epuck": test})
    runs = tuple(replace(run, scores=older) for run in data.runs["ga"])
    data = replace(data, runs={**data.runs, "ga": runs})
    assert verdict(claims(data), "GA", "without crashing (strict") == NOT_MEASURED


def test_the_held_out_order_is_another_one():
    data = study(LIKE_THE_PAPER)
    lucky = tuple(run(seed, 245 + seed, 200, 100 + seed) for seed in range(12))
    data = replace(data, runs={**data.runs, "de-best": lucky})
    assert verdict(claims(data), "DE/best", "exceeds", "GA", "stored") == CONSISTENT
    for robot in data.robots:
        found = held_out_order(data, robot)
        assert verdict(found, "DE/best", "exceeds", "GA") == INCONSISTENT


def test_held_out_orders_are_decided_as_in_the_report():
    """Baselines are another family: they do not raise what p has to be below."""
    shifts = {"de-best": 4.5, "de-rand": 2.2, "ga": 0.0}
    runs = {
        name: tuple(run(i, 200, 1, 200 + shift + i) for i in range(10))
        for name, shift in shifts.items()
    }
    alone = held_out_order(study({}, runs=runs), "epuck")
    assert verdict(alone, "DE/best", "exceeds", "GA") == CONSISTENT
    baselines = ("cma-es", "one-plus-one-es", "random-search")
    configs = {name: load_config(find_config(name)) for name in (*NAMES, *baselines)}
    runs |= dict.fromkeys(baselines, runs["ga"])
    together = study({}, runs=runs, configs=configs)
    found = held_out_order(together, "epuck")
    assert verdict(found, "DE/best", "exceeds", "GA") == CONSISTENT
    (row,) = [
        row
        for row in comparisons(together)["held-out epuck"]
        if (row.a, row.b) == ("de-best", "ga")
    ]
    assert row.family == 3 and row.decided
    others = [
        (row.a, row.b)
        for row in comparisons(together)["held-out epuck"]
        if row.b in baselines
    ]
    assert others == [("de-best", name) for name in baselines]


def test_verdicts_are_counted():
    kinds = [CONSISTENT, UNDECIDED, TOO_FEW, UNDECIDED, UNDECIDED, TOO_FEW]
    counts = tally([Claim("it is so", "-", "3", kind) for kind in kinds])
    assert list(counts.items()) == [(UNDECIDED, 3), (TOO_FEW, 2), (CONSISTENT, 1)]


def test_reproduction_says_everything_once():
    data = study(
        LIKE_THE_PAPER,
        missing=("ga: no finished run of seed 9",),
        yardstick={
            "epuck_kinematic": HeldOut(mean=195.8, crash_rate=0.0, starts=1000),
            "epuck": HeldOut(mean=196.9, crash_rate=0.0, starts=1000),
        },
    )
    text = reproduction(data, None, UNEVOLVED, "python -m evolution.reproduce --quick")
    assert text == reproduction(
        data, None, UNEVOLVED, "python -m evolution.reproduce --quick"
    )
    assert "python -m evolution.reproduce --quick" in text
    assert "ga: no finished run of seed 9" in text
    assert "| literal | 150 | 249.0 | 248.0 | circler 100% |" in text
    assert "| wall-follower, written by hand |  |  | 196.9 | 195.8 |  |" in text
    # the highest stored is worth 100 less than the champion
    assert "| DE/best/1/bin | 12 | 242.5 [239.8, 245.2] | 137.0 [137.0" in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert all(line.endswith("|") for line in tables)
    for heading in ("claims", "stored fitness hides", "differs from the original"):
        assert sum(heading in line for line in text.splitlines() if line[0:1] == "#")


def test_reproduction_of_a_single_run():
    data = study({"de-best": 200.0}, n=1, robots=("epuck",))
    text = reproduction(data, data, UNEVOLVED, "command")
    assert TOO_FEW in text
    assert "Missing: no such study" not in text
    alone = reproduction(data, None, UNEVOLVED, "command")
    assert "Missing: no such study was given." in alone


def test_the_simulator_is_what_runs_were_on():
    """A run that was too short to climb never was on wheels."""
    data = study({"ga": 200.0}, n=2)
    first, last = data.runs["ga"]
    history = {**last.history, "climbed": np.repeat([0.0, 1.0], 5)}
    climbed = replace(last, history=history)
    both = replace(data, runs={"ga": (first, climbed)})
    assert evolved_on(data) == "the kinematic robot"
    assert evolved_on(both) == "the kinematic robot, then on the wheeled robot"


def test_the_printed_equation_leaves_nothing_to_evolve():
    config = load_config(find_config("de-best"))
    config = config.model_copy(update={"steps": 60, "trials": 3})
    found = {name: first_generation(config, name) for name in ("literal", "product")}
    assert found["literal"].individuals == 150
    assert found["literal"].best > 0.75 * 60
    assert found["product"].best < 0.2 * 60
    near_walls = ("wall follower", "hugger")
    assert sum(found["literal"].behaviour[name] for name in near_walls) < 0.05


# what is settled


def pair_of(a: np.ndarray, b: np.ndarray):
    (pair,) = comparisons_of({"a": a, "b": b}, lambda a, b: True, 10)
    return pair


def test_more_runs_are_needed_where_the_spread_is_wide_and_the_shift_near_the_margin():
    base = 200 + 3 * np.arange(-10.0, 11)
    narrow, wide = pair_of(base, base + 0.5), pair_of(base, base * 2 - 200 + 0.5)
    middle = pair_of(base, base + 5)
    few, more, most = (runs_needed(each) for each in (narrow, wide, middle))
    assert few is not None and more is not None and most is not None
    assert 21 < few < more
    # as far from no difference as from the margin: twice as near as 0.5 is, so 4 times
    assert 3 < most / few < 4.5
    assert runs_needed(pair_of(np.full(10, 3.0), np.full(10, 3.0))) is None


def test_so_many_runs_as_are_named_do_show_it():
    rng = np.random.default_rng(0)
    few = pair_of(*rng.normal([[200], [201]], 20, (2, 20)))
    needed = runs_needed(few)
    assert needed is not None
    shift = few.equivalence.shift
    shown = 0
    for _ in range(60):
        a, b = rng.normal([[200 + shift], [200]], 20, (2, needed))
        pair = pair_of(a, b)
        shown += pair.decided or pair.equivalent
    assert shown > 36


def test_the_page_says_what_is_settled_and_what_is_not():
    data = study({"de-best": 237.0, "de-rand": 206.0, "ga": 237.0})
    text = reproduction(data, None, [], "command")
    settled, rest = text.split("## What is not settled, and what would settle it")
    open_, _ = rest.split("## What there is")
    line = "DE/best/1/bin earns more than DE/rand/1/bin: medians 237 and 206"
    assert line in settled
    assert "DE/best/1/bin and GA earn the same: they differ by less than 10 of 300" in (
        settled
    )
    assert (
        "- DE/rand/1/bin exceeds GA in best (stored) fitness\n"
        in (settled.split("that do not hold here")[1])
    )
    assert "earns more, or both the same" not in open_
    assert "undecided by these runs" in open_


def test_fewer_runs_than_planned_are_provisional():
    few, all_ = (
        reproduction(study(LIKE_THE_PAPER, n=n), None, [], "command") for n in (12, 100)
    )
    assert "Provisional: there are 12 of the 100 runs" in few
    assert "Provisional" not in all_
