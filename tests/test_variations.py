"""The page of variations: against the unchanged algorithm, and the paper's order."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from epuck_mj.errors import UserError
from evolution.judging.scores import HeldOut, Scores
from evolution.settings.config_files import find_config, load_config
from evolution.statistics.significance import holm, mann_whitney
from evolution.study.data import StudyData
from evolution.study.finished_run import FinishedRun
from evolution.study.pack import pack_studies
from evolution.variations import __main__ as module
from evolution.variations.__main__ import report_variations
from evolution.variations.change_words import in_words
from evolution.variations.varied import UNCHANGED, orders, varied_of
from tests.finished_runs import finished_run

N = 12


def run(seed: int, held_out: float, stored: float) -> FinishedRun:
    test = HeldOut(mean=held_out, crash_rate=0.1, starts=200)
    return finished_run(
        seed,
        {"evaluations": np.array([1.0]), "best": np.array([stored])},
        Scores(stored=stored, held_out={"epuck": test}),
    )


def study(fitness: dict[str, tuple[float, float]], steps: int = 300) -> StudyData:
    """Runs by experiment; held-out and best stored fitness, spread by some units."""
    return StudyData(
        path=Path("variations"),
        configs={name: load_config(find_config("ga")) for name in fitness},
        runs={
            name: tuple(run(seed, held_out + seed, stored + seed) for seed in range(N))
            for name, (held_out, stored) in fitness.items()
        },
        robots=("epuck",),
        steps=steps,
        yardstick={},
        missing=(),
    )


OURS = {"de-best": (215.0, 245.0), "de-rand": (157.0, 170.0), "ga": (214.0, 243.0)}
"""Like our own runs: the GA is far above DE/rand, other than in the paper."""


def test_another_step_fitness_is_not_compared():
    data = study(OURS | {"ga-literal": (280.0, 299.0), "ga-bits-4": (150.0, 200.0)})
    literal = data.configs["ga"].model_copy(update={"fitness": "literal"})
    data.configs["ga-literal"] = literal  # type: ignore[index]
    found = {each.change: each for each in varied_of([data]) if each.algorithm == "ga"}
    assert found["literal"].against is None
    assert np.isnan(found["literal"].p)
    assert not found["literal"].differs
    # nor does it count among the tests that are adjusted for
    alone = mann_whitney(found["bits-4"].held_out, found[UNCHANGED].held_out)
    assert found["bits-4"].p == pytest.approx(alone.p)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("f-0.5-cr-1.0", "F 0.5, CR 1.0"),
        ("gray-16", "16 bits, Gray code"),
        ("two-points", "two-point crossover"),
        ("reevaluated-best-15", "reevaluated best 15"),
        ("none", "no bounds"),
    ],
)
def test_changes_are_said_in_words(change, words):
    assert in_words(change) == words


def test_each_is_held_against_the_unchanged_one():
    data = study(
        OURS
        | {
            "ga-tournament-2": (214.0, 243.0),
            "ga-bits-4": (150.0, 200.0),
            "de-best-clip": (260.0, 280.0),
            # not of the paper's
            "cma-es": (230.0, 250.0),
        }
    )
    found = {(each.algorithm, each.change): each for each in varied_of([data])}
    assert set(found) == {
        *((name, UNCHANGED) for name in OURS),
        *(("ga", "tournament-2"), ("ga", "bits-4"), ("de-best", "clip")),
    }
    raw = [
        stats.mannwhitneyu(
            found[name, change].held_out, found[name, UNCHANGED].held_out, method=how
        ).pvalue
        for name, change, how in (
            ("ga", "tournament-2", "asymptotic"),
            ("ga", "bits-4", "exact"),
            ("de-best", "clip", "exact"),
        )
    ]
    adjusted = holm(np.array(raw))
    same, worse, better = (
        found[key]
        for key in (("ga", "tournament-2"), ("ga", "bits-4"), ("de-best", "clip"))
    )
    assert [each.p for each in (same, worse, better)] == pytest.approx(adjusted)
    assert [each.differs for each in (same, worse, better)] == [False, True, True]
    shifts = [each.against.shift for each in (same, worse, better) if each.against]
    assert shifts == [0.0, -64.0, 45.0]
    assert found["ga", UNCHANGED].against is None


def test_trials_of_other_lengths_have_no_unchanged_one():
    other = study({f"{name}-steps-150": (70.0, 90.0) for name in OURS}, steps=150)
    found = varied_of([study(OURS), other])
    assert all(each.against is None for each in found)
    assert {each.steps for each in found} == {150, 300}


def test_the_papers_order_comes_back_with_the_change_that_brings_it():
    data = study(
        OURS
        | {
            # a GA that is as bad as the paper's
            "ga-tournament-2": (140.0, 160.0),
            # all three in the paper's order
            "de-best-hidden-2": (215.0, 245.0),
            "de-rand-hidden-2": (190.0, 215.0),
            "ga-hidden-2": (180.0, 200.0),
        }
    )
    found = {order.change: order for order in orders(varied_of([data]))}
    assert set(found) == {UNCHANGED, "tournament-2", "hidden-2"}
    ours, weak, all_three = (
        found[change] for change in (UNCHANGED, "tournament-2", "hidden-2")
    )
    assert ours.chance == 0 and not ours.possible and not ours.typical
    assert weak.varied == ("ga",) and weak.typical and weak.possible
    assert weak.medians == (250.5, 175.5, 165.5)
    assert all_three.varied == ("de-best", "de-rand", "ga") and all_three.chance == 1


def test_fitness_that_is_equal_to_three_decimals_is_equal():
    highest = {name: (280.0, 300.0 - 1e-6 * i) for i, name in enumerate(OURS)}
    (order,) = orders(varied_of([study(highest)]))
    assert order.medians[0] == order.medians[1]
    assert not order.typical
    # by luck only: runs of an algorithm differ by whole units
    assert order.chance < 0.3


def test_without_one_of_the_three_there_is_no_order():
    data = study({"de-best": (215.0, 245.0), "ga": (214.0, 243.0)})
    assert orders(varied_of([data])) == []


def test_the_command_writes_page_and_figure(tmp_path, monkeypatch, capsys):
    data = study(OURS | {"ga-tournament-2": (140.0, 160.0)})
    monkeypatch.setattr("evolution.study.data.load_study", lambda path: data)
    out = tmp_path / "out"
    assert report_variations(["here", "--output", str(out)]) == 0
    text = (out / "variations.md").read_text()
    assert "1 variation, 48 runs in all" in text
    assert "above 5 % in 1 of 2 rows of the figure" in text
    # the paper's 202.775 is below all of the one, and above all of the other
    assert "| GA | none | 202.775 |" in text
    order, effect = (
        line for line in text.splitlines() if line.startswith("| tournament 2")
    )
    assert order == "| tournament 2 | GA | 12 | 1 | 250 | 176 | 166 | the paper's |"
    assert effect.endswith("| worse |")
    assert (out / "figures" / f"{module.FIGURE}.png").stat().st_size > 1000
    assert "tournament 2" in (out / "variations.html").read_text()
    before = (out / "variations.md").read_bytes()
    report_variations(["here", "--output", str(out)])
    assert (out / "variations.md").read_bytes() == before


@pytest.mark.parametrize(
    "command", [pack_studies, lambda argv: report_variations(["--output", "out"])]
)
def test_no_study_at_all_is_refused(command):
    with pytest.raises(UserError, match="expected study directories"):
        command([])


def test_studies_of_other_algorithms_are_refused(tmp_path, monkeypatch):
    data = study({"cma-es": (230.0, 250.0)})
    monkeypatch.setattr("evolution.study.data.load_study", lambda path: data)
    with pytest.raises(UserError, match="named after de-best, de-rand or ga, got none"):
        report_variations(["here", "--output", str(tmp_path / "out")])
