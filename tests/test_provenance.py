"""Provenance of a run, read back."""

import json
from pathlib import Path

import pytest

from epuck_mj.errors import UserError
from evolution.run.provenance import read_provenance
from evolution.study.provenances import (
    provenance_of,
    read_provenances,
    together,
    write_provenances,
)

RESULTS = Path(__file__).resolve().parent.parent / "results"


def test_every_shipped_provenance_is_read():
    studies = {path.parent for path in RESULTS.glob("*/champions.parquet")}
    paths = sorted(study / "provenance.json" for study in studies)
    assert {"paper", "transfer", "wheels"} <= {study.name for study in studies}
    runs = 0
    for path in paths:
        found = read_provenances(path)
        assert list(found.values()) == json.loads(path.read_text())["provenances"]
        runs += sum(entry["runs"] for entry in found.values())
    assert runs > 80


FIRST = {
    "argv": ["paper"],
    "threads": 1,
    "git": {"commit": "abc", "modified": False},
    "started": "2026-01-01T00:00:00+00:00",
    "finished": "2026-01-01T01:00:00+00:00",
}


def test_runs_of_one_provenance_share_an_entry(tmp_path):
    """What may change results makes another one; times, threads, commands do not."""
    later = FIRST | {
        "threads": 2,
        "argv": ["my own"],
        "finished": "2026-01-02T00:00:00+00:00",
    }
    gone_on = FIRST | {"resumed": [later, FIRST]}
    other = FIRST | {"git": {"commit": "def", "modified": False}}
    elsewhere = FIRST | {"resumed": [other, later, other]}
    entries = [provenance_of(each) for each in (FIRST, later, gone_on, elsewhere)]
    first, _, _, last = (entry["id"] for entry in entries)
    assert [entry["id"] for entry in entries] == [first, first, first, last]
    assert first != last
    found = together(entries)
    assert found[first]["threads"] == [1, 2]
    assert found[first]["commands"] == ["'my own'", "paper"]
    assert found[first]["started"] == FIRST["started"]
    assert found[first]["finished"] == later["finished"]
    assert [each["git"] for each in found[last]["resumed"]] == [other["git"]]
    write_provenances(tmp_path / "new.json", found, [last, first, first])
    again = read_provenances(tmp_path / "new.json")
    assert [(name, each["runs"]) for name, each in again.items()] == [
        (last, 1),
        (first, 2),
    ]
    # however often a run is added
    assert together([*again.values(), *entries]) == again


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"processor": {"flags": 5}}, "processor.flags"),
        ({"processor": "fast"}, "processor"),
        ({"versions": ["mujoco"]}, "versions"),
        ({"versions": {"mujoco": 3}}, "versions.mujoco"),
        ({"argv": "ga"}, "argv"),
        ({"git": {"commit": 1, "modified": False}}, "git.commit"),
        ({"mjcf_sha256": []}, "mjcf_sha256"),
        ({"own_sha256": "abc"}, "own_sha256"),
        ({"finished": True}, "finished"),
        ({"resumed": 3}, "resumed"),
        ({"resumed": [{"argv": [1]}]}, "resumed.0.argv.0"),
    ],
)
def test_what_it_is_not_is_named(change, where, tmp_path):
    path = tmp_path / "provenance.json"
    path.write_text(json.dumps(change))
    with pytest.raises(UserError) as error:
        read_provenance(path)
    assert str(error.value).startswith(f"'{path}' is damaged: {where}: ")
