"""Scores: shipped ones come back byte for byte, what is no score is named."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from epuck_mj.errors import UserError
from evolution.judging.scores import KnownScores, Scores
from evolution.study.columns import table_of
from evolution.study.directory import StudyDirectory
from evolution.study.table_files import write_table

RESULTS = Path(__file__).resolve().parent.parent / "results"
TABLES = sorted(RESULTS.glob("*/champions.parquet"))
YARDSTICKS = sorted(RESULTS.glob("*/wall-follower.json"))
OLD = {"mean": 100.0, "crash_rate": 0.1, "starts": 1000}
"""All that the oldest held-out evaluations say."""


def full() -> dict:
    """Scores of a champion that was tested in every way."""
    test = OLD | {
        "standard_deviation": 40.0,
        "interval": [97.5, 102.5],
        "worst": 20.0,
        "collisions_per_minute": 0.2,
        "behaviour": {"crashed": 0.1, "hugger": 0.2, "wall follower": 0.7},
        "metrics": {"clearance_mean": 0.008, "success": 0.25, "laps": None},
    }
    return {
        "stored": 120.0,
        "validation": 101.0,
        "held_out": {"epuck": test, "epuck_kinematic": test},
        "best_stored": {"fitness": 130.0, "held_out": 90.0},
        "held_out_as_evolved": {"epuck": test},
    }


def test_every_shipped_champion_comes_back_byte_for_byte(tmp_path):
    n = 0
    for path in TABLES:
        study = StudyDirectory(path.parent)
        runs = study.tables.runs(study.stored_config()).values()
        for run in runs:
            scores = Scores.read(run.champion.scores, path)
            again = replace(run.champion, scores=scores.to_dict())
            assert again.to_json() == run.champion.to_json(), run.path
        table = table_of([run.row for run in runs])
        write_table(tmp_path / "table.parquet", table)
        assert (tmp_path / "table.parquet").read_bytes() == path.read_bytes()
        n += len(runs)
    assert n > 80


def test_every_shipped_yardstick_comes_back_byte_for_byte():
    assert {"paper", "transfer", "wheels"} <= {path.parent.name for path in YARDSTICKS}
    for path in YARDSTICKS:
        fields = KnownScores.read(json.loads(path.read_text()), path).to_dict()
        assert (json.dumps(fields, indent=1) + "\n").encode() == path.read_bytes()


def test_what_is_known_is_written_and_nothing_else():
    for scores in (full(), {"stored": 1.0, "held_out": {"epuck": OLD}}):
        written = Scores.read(scores, Path("champion.json")).to_dict()
        assert json.loads(json.dumps(written, allow_nan=False)) == scores
        assert list(written) == list(scores)


def test_an_old_file_knows_less():
    scores = {"stored": 120.0, "held_out": {"epuck": OLD}, "note": "of a person"}
    found = Scores.read(scores, Path("champion.json"))
    assert math.isnan(found.validation)
    assert found.best_stored is None
    assert found.held_out_as_evolved == {}
    test = found.held_out["epuck"]
    assert (test.mean, test.crash_rate, test.starts) == (100.0, 0.1, 1000)
    assert test.behaviour == test.metrics == {}
    unknown = (
        test.standard_deviation,
        *test.interval,
        test.worst,
        test.collisions_per_minute,
        test.following,
        test.clearance,
        test.whole_laps,
    )
    assert all(map(math.isnan, unknown))


def test_what_a_champion_does_is_read_from_its_trials():
    test = Scores.read(full(), Path("champion.json")).held_out["epuck"]
    assert test.following == pytest.approx(0.9)
    assert (test.clearance, test.whole_laps) == (0.008, 0.25)
    never_near = test.model_copy(update={"metrics": {"clearance_mean": None}})
    assert math.isnan(never_near.clearance)
    lost = test.model_copy(update={"behaviour": {"searcher": 1.0}})
    assert lost.following == 0


NUMBER = "expected a number from -1e+100 to 1e+100"
STARTS = "starts: expected a whole number from 2 to 100,000"


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        ("stored", ..., "stored: Field required"),
        ("stored", None, f"stored: {NUMBER}"),
        ("stored", "120.0", f"stored: {NUMBER}"),
        ("stored", True, f"stored: {NUMBER}"),
        ("stored", math.nan, f"stored: {NUMBER}"),
        ("stored", 1e308, f"stored: {NUMBER}"),
        ("held_out.epuck.crash_rate", 1.5, "crash_rate: expected a number from 0 to 1"),
        ("held_out.epuck.starts", 10**9, STARTS),
        ("validation", "high", f"validation: {NUMBER}"),
        ("held_out", ..., "held_out: Field required"),
        ("held_out", {}, "held_out: Dictionary should have at least 1 item"),
        ("held_out", [1], "held_out: Input should be a valid dictionary"),
        ("held_out.epuck", 3, "held_out.epuck: Input should be a valid dictionary"),
        ("held_out.epuck.mean", ..., "held_out.epuck.mean: Field required"),
        ("held_out.epuck.mean", "1", f"held_out.epuck.mean: {NUMBER}"),
        ("held_out.epuck.mean", False, f"held_out.epuck.mean: {NUMBER}"),
        ("held_out.epuck.mean", -math.inf, f"held_out.epuck.mean: {NUMBER}"),
        ("held_out.epuck.mean", 10**400, f"held_out.epuck.mean: {NUMBER}"),
        ("held_out.epuck.worst", math.nan, f"held_out.epuck.worst: {NUMBER}"),
        ("held_out.epuck.crash_rate", ..., "epuck.crash_rate: Field required"),
        ("held_out.epuck.crash_rate", 1.5, "crash_rate: expected a number from 0 to 1"),
        (
            "held_out.epuck.behaviour.crashed",
            -0.1,
            "crashed: expected a number from 0 to 1",
        ),
        ("held_out.epuck.mean", 1e308, "mean: expected a number from"),
        ("held_out.epuck.starts", ..., "held_out.epuck.starts: Field required"),
        ("held_out.epuck.starts", "9", STARTS),
        ("held_out.epuck.starts", 9.0, STARTS),
        ("held_out.epuck.starts", True, STARTS),
        ("held_out.epuck.starts", 1, STARTS),
        ("held_out.epuck.interval", [1, 2, 3], "interval: Tuple should have at most 2"),
        ("held_out.epuck.interval", [1, True], f"epuck.interval.1: {NUMBER}"),
        ("held_out.epuck.behaviour", [], "behaviour: Input should be a valid dict"),
        ("held_out.epuck.behaviour.crashed", "no", "crashed: expected a number fro"),
        ("held_out.epuck.metrics.laps", math.inf, f"metrics.laps: {NUMBER}"),
        ("best_stored", {}, "best_stored.fitness: Field required"),
        ("best_stored.held_out", "1", f"best_stored.held_out: {NUMBER}"),
        ("held_out_as_evolved.epuck.mean", None, f"as_evolved.epuck.mean: {NUMBER}"),
    ],
)
def test_what_is_no_score_is_named(place, value, said):
    scores = full()
    *parents, key = place.split(".")
    fields = scores
    for parent in parents:
        fields[parent] = fields = dict(fields[parent])
    if value is ...:
        del fields[key]
    else:
        fields[key] = value
    # as it is read from a file
    scores = json.loads(json.dumps(scores))
    with pytest.raises(UserError) as error:
        Scores.read(scores, Path("runs/ga/champion.json"))
    message = str(error.value)
    assert message.startswith("'runs/ga/champion.json' is damaged: ")
    assert said in message
    assert "\n" not in message


def test_a_file_that_anybody_made_may_say_nothing_but_nothing_false():
    path = Path("champion.json")
    assert KnownScores.read({"note": "of a person"}, path) == KnownScores()
    assert KnownScores.read(full(), path).held_out == Scores.read(full(), path).held_out
    for wrong in ({"stored": "120"}, {"held_out": {"mine": {"mean": "no"}}}):
        with pytest.raises(UserError, match=r"^'champion.json' is damaged: "):
            KnownScores.read(wrong, path)


def test_scores_do_not_change():
    scores = Scores.read(full(), Path("champion.json"))
    with pytest.raises(ValueError, match="frozen"):
        scores.stored = 300.0  # type: ignore[misc]
