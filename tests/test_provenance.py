"""Provenance of a run, read back."""

import json
from pathlib import Path

import pytest

from epuck_mj.errors import UserError
from evolution.run.provenance import read_provenance

RESULTS = Path(__file__).resolve().parent.parent / "results"


def test_every_shipped_provenance_is_read():
    paths = sorted(RESULTS.glob("*/*/seed-*/provenance.json"))
    assert len(paths) > 80
    for path in paths:
        assert read_provenance(path) == json.loads(path.read_text())


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
