"""Controller files: read back, and refused."""

import json

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.policies.file import ControllerFile, Origin, load_controller
from epuck_mj.policies.network import Network
from epuck_mj.step.control import TaskParameters


@pytest.fixture
def stored() -> ControllerFile:
    genome = np.random.default_rng(3).uniform(-5, 5, 40)
    origin = Origin("epuck", "arena", 0.02, {"arena": "ab", "robot": "cd"})
    return ControllerFile(
        Network(), genome, TaskParameters(7, fitness="literal"), origin, {"stored": 1.0}
    )


def test_file_comes_back_bit_for_bit(tmp_path, stored):
    path = tmp_path / "champion.json"
    path.write_text(stored.to_json())
    back = load_controller(path)
    np.testing.assert_array_equal(back.genome, stored.genome)
    for name in ("network", "task", "origin", "scores"):
        assert getattr(back, name) == getattr(stored, name)
    observation = np.linspace(0, 1, 8)
    np.testing.assert_array_equal(
        back.controller(observation), stored.controller(observation)
    )


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"format": "other"}, "expected format 'epuck_mj.controller/1'"),
        ({"genome": [1.0, 2.0]}, "expected 40 genes, got 2"),
        ({"genome": [[1.0] * 40]}, "expected 40 genes, got 1"),
        ({"genome": [[1.0]] * 40}, "gene: expected a number from -1e+100 to 1e+100"),
        ({"genome": [10**400] * 40}, "to 1e+100, got 1000"),
        ({"genome": [1e308] * 40}, "to 1e+100, got 1e+308"),
        ({"genome": ["1.5"] * 40}, "to 1e+100, got '1.5'"),
        ({"genome": [True] * 40}, "to 1e+100, got True"),
        ({"genome": None}, "expected a list as genome, got None"),
        ({"network": {"hidden": 10**9, "biases": False}}, "to 1,000, got 1000000000"),
        ({"network": {"hidden": "4", "biases": False}}, "to 1,000, got '4'"),
        ({"network": {"hidden": 4, "biases": 0}}, "biases: expected true or false"),
        ({"network": {"layers": 3}}, "layers"),
        ({"network": {"hidden": 5, "biases": False}}, "expected 50 genes, got 40"),
        ({"network": None}, "expected an object as network"),
        ({"scores": [1.0]}, "expected an object as scores"),
        ({"task": {}}, "not the parameters of a task: 'speeds'"),
        ({"scene": {}}, "does not say which robot it is for"),
        ({"scene": {"robot": "epuck"}}, "does not say which arena it is for"),
        ({"scene": {"robot": 1, "arena": "arena"}}, "which robot it is for"),
        (
            {"scene": {"robot": "a", "arena": "b", "start_clearance": 2.0}},
            "start_clearance: expected a number above 0, at most 1 m (le",
        ),
        (
            {"scene": {"robot": "a", "arena": "b", "mjcf_sha256": [1]}},
            "expected an object as mjcf_sha256, got [1]",
        ),
        (
            {"scene": {"robot": "a", "arena": "b", "mjcf_sha256": {"arena": 1}}},
            "expected texts in mjcf_sha256, got {'arena': 1}",
        ),
    ],
)
def test_foreign_files_are_refused(tmp_path, stored, change, expected):
    path = tmp_path / "champion.json"
    path.write_text(json.dumps(json.loads(stored.to_json()) | change))
    with pytest.raises(UserError, match="is not a controller file") as error:
        load_controller(path)
    assert expected in str(error.value)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"steps": 0}, "steps: expected a whole number from 1 to 10,000,000, got 0"),
        ({"steps": True}, "got True"),
        ({"steps": 10**400}, "got 1000"),
        ({"steps": "300"}, "got '300'"),
        ({"control_step": -0.1}, "control_step: expected a number above 0"),
        ({"control_step": 1e6}, "at most 10 s, got 1000000.0"),
        ({"sensor_range": 40}, "at most 1 m (lengths are metres), got 40"),
        (
            {"speeds": {"forward": 128.8, "turn": 4.86}},
            "forward: expected a number above 0, at most 0.13 m/s (speeds are metres "
            "a second), got 128.8",
        ),
        ({"speeds": {"forward": 0.1, "turn": 278}}, "turn: expected a number above 0"),
        ({"fitness": "best"}, "unknown fitness 'best'"),
        ({"fitness": ["product"]}, "unknown fitness ['product']"),
        ({"speeds": {"sideways": 1.0}}, "sideways"),
        ({"wheels": 3}, "wheels"),
    ],
)
def test_another_task_is_refused(tmp_path, stored, change, expected):
    fields = json.loads(stored.to_json())
    fields["task"] |= change
    path = tmp_path / "champion.json"
    path.write_text(json.dumps(fields))
    with pytest.raises(UserError, match="not the parameters of a task: ") as error:
        load_controller(path)
    assert expected in str(error.value)


def test_missing_and_broken_files_are_refused(tmp_path, stored):
    with pytest.raises(UserError, match="cannot read"):
        load_controller(tmp_path / "nothing.json")
    path = tmp_path / "half.json"
    path.write_text(stored.to_json()[:100])
    with pytest.raises(UserError, match="is not JSON"):
        load_controller(path)
    path.write_text("[1, 2]")
    with pytest.raises(UserError, match="expected a mapping of keys to values, got l"):
        load_controller(path)


def test_files_of_before_do_not_say_how_clear_their_starts_were(tmp_path, stored):
    fields = json.loads(stored.to_json())
    del fields["scene"]["start_clearance"]
    fields["scene"]["note"] = "of a person"
    path = tmp_path / "champion.json"
    path.write_text(json.dumps(fields))
    origin = load_controller(path).origin
    assert (origin.robot, origin.arena, origin.start_clearance) == (
        "epuck",
        "arena",
        None,
    )
