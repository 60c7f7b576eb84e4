"""The follower by rule: worked by hand, number by number."""

import re
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.policies.follower import GENE_MAX, NUMBERS, Follower, Rule, numbers_of
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters, run_trials
from epuck_mj.step.motors import Speeds

BY_HAND = {
    "near": 0.25,
    "slow": 0.5,
    "creep": 0.125,
    "avoid": 0.5,
    "away": 0.75,
    "left": 0.25,
    "diagonal": 0.25,
    "target": 0.25,
    "gain": 2.0,
    "damping": 4.0,
    "turn": 0.5,
    "lost": 0.875,
    "search": 0.0625,
}


def genome(**numbers: float) -> np.ndarray:
    """Genes `(13,)` of numbers that are by hand unless others are given."""
    values = BY_HAND | numbers
    assert list(values) == list(NUMBERS)
    shares = [
        (values[name] - low) / (high - low) for name, (low, high) in NUMBERS.items()
    ]
    return GENE_MAX * (2 * np.array(shares) - 1)


def seen(**sensors: float) -> np.ndarray:
    """Observation `(8,)`: free, but for the sensors given."""
    return np.array([sensors.get(f"ps{i}", 1.0) for i in range(8)])


def actions(*observations: np.ndarray, **numbers: float) -> np.ndarray:
    policy = Follower().decode(genome(**numbers)).started(None)
    return np.array([policy(each) for each in observations])


@pytest.mark.parametrize(
    ("sensors", "forward", "turn"),
    [
        # nothing in sight: full speed, on the wide arc
        ({}, 1.0, 0.0625),
        # at the set value: straight on
        ({"ps1": 0.25, "ps2": 0.25}, 1.0, 0.0),
        # a quarter of the one and three of the other
        ({"ps1": 0.5, "ps2": 0.25}, 1.0, 0.125),
        ({"ps1": 0.25, "ps2": 0.3125}, 1.0, 0.09375),
        # too near, as far as it may turn
        ({"ps1": 0.0, "ps2": 0.0}, 1.0, -0.5),
        ({"ps1": 0.25, "ps2": 0.75}, 1.0, 0.5),
        # just lost
        ({"ps1": 0.875, "ps2": 0.875}, 1.0, 0.0625),
        # (0.625 - 0.25) / 0.5, but not yet turning away
        ({"ps0": 0.625, "ps1": 0.25, "ps2": 0.25}, 0.75, 0.0),
        ({"ps7": 0.5, "ps1": 0.25, "ps2": 0.25}, 0.5, 0.0),
        # turning away, whatever is at the side
        ({"ps0": 0.375, "ps1": 0.75}, 0.25, -0.75),
        ({"ps7": 0.0}, 0.125, -0.75),
        # the left diagonal counts as 0.25 more than it reads
        ({"ps6": 0.5}, 1.0, 0.0625),
        ({"ps6": 0.125}, 0.25, -0.75),
        # nobody looks there
        ({"ps3": 0.0, "ps4": 0.0, "ps5": 0.0}, 1.0, 0.0625),
    ],
)
def test_by_hand(sensors, forward, turn):
    found = actions(seen(**sensors))[0]
    np.testing.assert_allclose(found, [forward, turn], rtol=0, atol=1e-12)


def test_changes_by_hand():
    away, nearer = seen(ps1=0.25, ps2=0.25), seen(ps1=0.25, ps2=0.1875)
    found = actions(away, nearer, nearer)
    # 2 (0.203125 - 0.25) + 4 (0.203125 - 0.25), then without the change
    np.testing.assert_allclose(found[:, 1], [0, -0.28125, -0.09375], atol=1e-12)
    # a wall that comes into sight is a change, too
    found = actions(seen(), away, damping=0.0)
    np.testing.assert_allclose(found[:, 1], [0.0625, 0.0], atol=1e-12)
    found = actions(seen(), away, damping=1.0)
    np.testing.assert_allclose(found[:, 1], [0.0625, -0.5], atol=1e-12)


def test_genes_are_numbers_from_the_lowest_to_the_highest():
    low, high = np.array(list(NUMBERS.values())).T
    assert (low < high).all() and len(NUMBERS) == 13
    n = np.full(13, GENE_MAX)
    np.testing.assert_array_equal(numbers_of(-n), low)
    np.testing.assert_allclose(numbers_of(n), high, rtol=1e-15)
    np.testing.assert_allclose(numbers_of(0 * n), (low + high) / 2)
    # beyond, nothing changes
    np.testing.assert_array_equal(numbers_of(-2e6 * n), low)
    batch = numbers_of(np.random.default_rng(0).uniform(-5, 5, (4, 3, 13)))
    assert batch.shape == (13, 4, 3) and batch.flags.c_contiguous
    np.testing.assert_allclose(numbers_of(genome()), list(BY_HAND.values()))


def test_the_page_has_the_numbers():
    page = (Path(__file__).resolve().parent.parent / "docs/transfer.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \|.*\| (\S+) \| (\S+) \|$", page, re.M)
    assert {name: (float(low), float(high)) for name, low, high in rows} == NUMBERS


def test_members_of_a_batch():
    numbers = numbers_of(np.random.default_rng(1).uniform(-5, 5, (20, 13)))
    both = np.random.default_rng(2).uniform(-1, 1, (20, 16))
    mask = np.arange(20) % 3 == 0
    rule = Rule(numbers)
    np.testing.assert_array_equal(rule[mask](both[mask]), rule(both)[mask])


def test_numbers_by_hand_follow_walls():
    task = TaskParameters(sensor_range=0.06, speeds=Speeds(0.08, 2.0))
    scene = load_scene("epuck_kinematic", "arena")
    starts = FreeSpace(scene, 0.02).sample(np.random.default_rng(0), 50)
    policy = Follower().decode(np.tile(genome(near=0.4, avoid=0.75), (50, 1)))
    trials = run_trials(robots_in(scene, 50), policy, starts, task)
    assert not trials.crashed.any()
    assert trials.fitness.mean() > 0.5 * task.steps
