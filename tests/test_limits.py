"""Limits: one table, and what needs more memory than there is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.constants import SPEED_MAX, TURN_RATE_MAX
from epuck_mj.errors import UserError
from epuck_mj.host import memory
from epuck_mj.host.limits import LIMITS, check, check_flag, shown
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.scene.xml_elements import DEPTH_MAX, ELEMENTS_MAX, elements_of
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record_tracks, record_trajectories
from evolution.run.generation_loop import Evolution
from evolution.search.differential_evolution import DifferentialEvolutionParameters
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import (
    find_config,
    load_config,
    shipped_experiments,
)
from evolution.settings.memory import check_needs, needs


@pytest.mark.parametrize("name", LIMITS)
def test_both_ends_are_allowed_and_nothing_beyond_or_beside_numbers(name):
    limit = LIMITS[name]
    step = 1 if limit.whole else 1e-9 * max(1, abs(limit.most))
    least = limit.least + step if limit.above else limit.least
    check(name, least)
    check(name, limit.most)
    wrong = [least - step, limit.most * 2 + 1, float("inf"), -float("inf")]
    wrong += [float("nan"), 10**400, True, "1", None, [1], 1j, 10**21 + 0.5]
    for value in wrong:
        if name in ("score", "gene") and value == 10**21 + 0.5:
            continue
        with pytest.raises(ValueError, match=f"^{name}: expected a .*, got ") as error:
            check(name, value)
        assert "\n" not in str(error.value)


def test_whole_numbers_are_no_fractions():
    for value in (2.0, np.float64(2)):
        with pytest.raises(ValueError, match="expected a whole number"):
            check("trials", value)
    check("control_step", 1)


def test_the_fastest_robot_is_within_the_limits():
    assert SPEED_MAX < LIMITS["v_max"].most < 1.02 * SPEED_MAX
    assert TURN_RATE_MAX < LIMITS["w_max"].most < 1.03 * TURN_RATE_MAX


def test_a_flag_is_called_as_it_is_typed():
    with pytest.raises(UserError) as error:
        check_flag("starts", 10**9, "worlds")
    assert str(error.value) == (
        "--starts: expected a whole number from 2 to 1,000, got 1000000000"
    )


def test_any_value_is_shown_on_one_short_line():
    deep: list = []
    for _ in range(100_000):
        deep = [deep]
    for value in (16**5000, deep, np.zeros((9, 9)), "a\nb" * 1000):
        assert "\n" not in shown(value)
        assert len(shown(value)) <= 60
    assert shown("a") == "'a'"


# --- memory


def test_this_computer_has_memory():
    assert 10**8 < memory.memory() < 10**15


@pytest.fixture
def small(monkeypatch):
    """A computer of 1 GB."""
    monkeypatch.setattr(memory, "memory", lambda: 10**9)


MANY = DifferentialEvolutionParameters(
    strategy="best", scale=0.8, crossover=1.0, population=100_000
)


def experiment(name: str, **changes) -> ExperimentConfig:
    config = load_config(find_config(name))
    optimizer = {k: v for k, v in changes.items() if hasattr(config.optimizer, k)}
    keys = {k: v for k, v in changes.items() if k not in optimizer}
    return config.model_copy(
        update={**keys, "optimizer": replace(config.optimizer, **optimizer)}
    )


@pytest.mark.parametrize(
    ("name", "changes", "keys"),
    [
        ("ga", {"trials": 100_000, "hidden": 1000}, "population (100) x trials (100,0"),
        (
            "ga",
            {"trials": 100_000, "steps": 10_000},
            "trials (100,000) x steps (10,000)",
        ),
        ("ga", {"steps": 100_000}, "test_starts (1,000) x steps (100,000)"),
        ("ga", {"population": 100_000, "tournament": 10_000}, "x tournament (10,000)"),
        (
            "ga",
            {"population": 10_000, "bits": 32, "hidden": 400},
            "weights of the netw",
        ),
        ("ga", {"test_starts": 100_000}, "test_starts (100,000) x steps (300)"),
        ("de-best", {"population": 100_000}, "population (100,000) x itself (100,000)"),
        (
            "one-plus-one-es",
            {"evaluations": 10**8, "hidden": 100},
            "evaluations / lineages (10,000,000) x weights of the network (1,000)",
        ),
        (
            "openai-es",
            {"pairs": 100_000, "hidden": 100},
            "pairs (100,000) x weights of",
        ),
        ("cma-es", {"hidden": 1000}, "weights of the network (10,000) x itself"),
        ("memetic-de", {"evolution": MANY}, "population (100,000) x itself (100,000)"),
        ("policy-gradient", {"batch": 100_000}, "batch (100,000) x trials (5) x steps"),
        ("imitators-then-cma-es", {"hidden": 1000}, "of the network (10,000) x itself"),
    ],
)
def test_products_count(name, changes, keys, small):
    config = experiment(name, **changes)
    with pytest.raises(UserError, match=r"this computer has 1\.0 GB$") as error:
        check_needs(config)
    assert keys in str(error.value)
    with pytest.raises(UserError, match="of memory"):
        Evolution(config)


def test_shipped_experiments_need_little():
    for name in shipped_experiments():
        config = load_config(find_config(name))
        for factors, size in needs(config):
            assert np.prod(list(factors.values())) * size < 2e8, factors


def test_what_is_recorded_is_refused_before_it_is_made(kinematic, small):
    task, many = TaskParameters(steps=10_000), np.zeros((1000, 3))
    said = r"^1,000 trials of 10,000 control steps needs about [0-9.]+ GB of memory"
    with pytest.raises(UserError, match=said):
        record_trajectories(kinematic, WallFollower(), many, task)
    with pytest.raises(UserError, match=said):
        record_tracks(None, None, many, task)  # pyright: ignore[reportArgumentType]
    with pytest.raises(UserError, match=r"^noise of 1,000 trials of 10,000 "):
        Conditions("strong").draw(np.random.default_rng(0), 1000, 10_000)


# --- XML


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "<a>" * 200_000,
            f", line 1: expected at most {DEPTH_MAX} elements inside one another",
        ),
        ("<a>\n" * 501 + "</a>" * 501, ", line 501: expected at most"),
        (
            "<a>" + "<b/>" * ELEMENTS_MAX + "</a>",
            f", line 1: expected at most {ELEMENTS_MAX:,} elements",
        ),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "expected no definitions of"),
        ("<a><b></a>", ", line 1: not well-formed XML: mismatched tag"),
        ("", "not well-formed XML: no element found"),
        ("<a>\0</a>", "not well-formed XML"),
        ("<a>&b;</a>", "not well-formed XML: undefined entity"),
    ],
)
def test_xml_that_is_no_arena_is_refused_before_it_is_parsed(text, said):
    with pytest.raises(UserError) as error:
        elements_of(text, Path("my.xml"))
    assert str(error.value).startswith("'my.xml'")
    assert said in str(error.value)


def test_other_xml_is_let_through():
    deep = elements_of("<a>" * DEPTH_MAX + "</a>" * DEPTH_MAX, Path("my.xml"))
    assert [element.depth for element in deep] == list(range(DEPTH_MAX))
    text = '<?xml version="1.0" encoding="utf-16"?><a b="ä"/><!-- c -->'
    (element,) = elements_of(text, Path("my.xml"))
    assert (element.tag, element.attributes) == ("a", {"b": "ä"})
