"""Configurations: the paper's numbers, a round trip, and what is refused."""

from dataclasses import FrozenInstanceError, asdict, replace
from pathlib import Path

import pytest
import yaml
from pydantic import ValidationError

from epuck_mj.constants import PROXIMITY_RANGE, SPEED_MAX, TURN_RATE_MAX
from epuck_mj.errors import UserError
from epuck_mj.policies.changes import NetworkWithChanges
from epuck_mj.policies.follower import GENE_MAX, Follower
from epuck_mj.step.conditions import Conditions
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import (
    CONFIGS,
    find_config,
    load_config,
    shipped_experiments,
)
from tests.refusals import refused
from tests.shipped import HYBRIDS

# Source: paper, section 4; what it leaves open: paper notes, section 3
PAPERS = {
    "de-best": {
        "algorithm": "differential_evolution",
        "strategy": "best",
        "population": 150,
        "scale": 0.8,
        "crossover": 1.0,
        "bounds_rule": "midpoint",
        "reevaluate_parents": False,
        "reevaluate_best": 0,
    },
    "de-rand": {
        "algorithm": "differential_evolution",
        "strategy": "rand",
        "population": 120,
        "scale": 0.7,
        "crossover": 1.0,
        "bounds_rule": "midpoint",
        "reevaluate_parents": False,
        "reevaluate_best": 0,
    },
    "ga": {
        "algorithm": "genetic_algorithm",
        "population": 100,
        "bits": 8,
        "tournament": 5,
        "crossover": 0.85,
        "mutation": 0.01,
        "elites": 0,
        "coding": "binary",
        "crossover_points": 1,
    },
}
BASELINES = {
    "random-search": {"algorithm": "random_search", "population": 100},
    "one-plus-one-es": {
        "algorithm": "evolution_strategy",
        "lineages": 10,
        "sigma": 1.0,
        "bounds_rule": "reflect",
        "reevaluate_parents": True,
    },
    "one-plus-one-es-as-first-shipped": {
        "algorithm": "evolution_strategy",
        "lineages": 10,
        "sigma": 1.0,
        "bounds_rule": "reflect",
        "reevaluate_parents": False,
    },
    "cma-es": {
        "algorithm": "cma_es",
        "population": 15,
        "sigma": 2.0,
        "restarts": True,
        "learning_rate_adaptation": False,
    },
    "lra-cma-es": {
        "algorithm": "cma_es",
        "population": 15,
        "sigma": 2.0,
        "restarts": False,
        "learning_rate_adaptation": True,
    },
    "l-shade": {
        "algorithm": "l_shade",
        "population": 100,
        "archive_rate": 2.6,
        "p_best": 0.11,
        "memory": 6,
        "budget": 0,
    },
    "openai-es": {
        "algorithm": "openai_es",
        "pairs": 20,
        "sigma": 0.5,
        "learning_rate": 0.2,
        "weight_decay": 0.0,
    },
    "ssshc": {
        "algorithm": "ssshc",
        "population": 20,
        "mutation": 0.1,
        "stochasticity": 0.1,
        "refinements": 1,
    },
}
SHIPPED = PAPERS | BASELINES
RANDOMISED = {
    "noise": "calibrated",
    "randomise": True,
    "trials": 8,
    "v_max": 0.04,
    "w_max": 1.0,
}
ON_REAL_ROBOTS = {
    "de-best-calibrated": ("de-best", {"noise": "calibrated"}),
    "de-best-randomised": ("de-best", RANDOMISED),
    "ga-randomised": ("ga", RANDOMISED),
}
"""The paper's again, under disturbances."""
OTHERS = ["policy-gradient", "best", "robust"]
ALL = sorted([*SHIPPED, *ON_REAL_ROBOTS, *HYBRIDS, *OTHERS])

every_experiment = pytest.mark.parametrize("name", SHIPPED)
COMMON = {
    "seed": 1,
    "evaluations": 30_000,
    "robot": "epuck_kinematic",
    "climb": 0.9,
    "arena": "arena",
    "trials": 5,
    "starts_every": 1,
    "own_starts": False,
    "steps": 300,
    "control_step": 0.1,
    "fitness": "product",
    "v_max": SPEED_MAX,
    "w_max": TURN_RATE_MAX,
    "sensor_range": 0.04,
    "noise": "none",
    "randomise": False,
    "randomise_all": False,
    "calibration": None,
    "start_clearance": 0.01,
    "body_margin": 0.0,
    "network": "feedforward",
    "hidden": 4,
    "biases": False,
    "weight_bound": 5.0,
    "weight_init": 5.0,
    "validation_starts": 200,
    "finalists": 5,
    "test_starts": 1000,
}


@pytest.fixture
def config_file(tmp_path):
    """Writes a YAML file and gives its path."""

    def write(content: str | bytes | dict) -> Path:
        path = tmp_path / "mine.yaml"
        if isinstance(content, dict):
            content = yaml.safe_dump(content)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def refusal(path: Path) -> str:
    """What `load_config` says of a file, which must be one line that names it."""
    message = refused(load_config, path)
    assert str(path) in message
    return message


EVERY_ALGORITHM = (
    "expected a mapping with 'algorithm', one of differential_evolution, "
    "genetic_algorithm, random_search, evolution_strategy, cma_es, l_shade, "
    "openai_es, ssshc"
)
GA = {"algorithm": "genetic_algorithm"}
DE = {
    "algorithm": "differential_evolution",
    "strategy": "best",
    "population": 10,
    "scale": 0.5,
    "crossover": 0.9,
}


def test_exactly_these_experiments_are_shipped():
    assert list(shipped_experiments()) == ALL


@pytest.mark.parametrize("name", ON_REAL_ROBOTS)
def test_experiments_on_real_robots_differ_in_nothing_else(name):
    config = load_config(find_config(name)).model_dump()
    ideal, changes = ON_REAL_ROBOTS[name]
    assert config == {**COMMON, "optimizer": SHIPPED[ideal], **changes}


@every_experiment
def test_a_shipped_experiment_is_the_papers_or_a_baseline_beside_it(name):
    config = load_config(find_config(name))
    assert config.model_dump() == {**COMMON, "optimizer": SHIPPED[name]}


def test_what_the_paper_notes_say_in_their_units():
    config = load_config(find_config("ga"))
    assert config.v_max == pytest.approx(0.1288, abs=5e-5)
    assert config.w_max == pytest.approx(4.86, abs=5e-3)
    assert config.sensor_range == PROXIMITY_RANGE == 0.04


@every_experiment
def test_derived_objects_hold_the_configs_values(name):
    config = load_config(find_config(name)).model_copy(
        update={
            "steps": 17,
            "control_step": 0.2,
            "fitness": "literal",
            "sensor_range": 0.03,
            "v_max": 0.1,
            "w_max": 2.0,
            "hidden": 3,
            "biases": True,
            "weight_bound": 7.0,
            "weight_init": 2.0,
        }
    )
    assert asdict(config.task) == {
        "steps": 17,
        "control_step": 0.2,
        "fitness": "literal",
        "sensor_range": 0.03,
        "speeds": {"forward": 0.1, "turn": 2.0},
    }
    assert config.topology.to_dict() == {"hidden": 3, "biases": True}
    assert asdict(config.search_space) == {
        # (8 sensors + bias) * 3 hidden + (3 hidden + bias) * 2 actions
        "genes": 35,
        "lower": -7.0,
        "upper": 7.0,
        "init_lower": -2.0,
        "init_upper": 2.0,
    }


def test_the_papers_network_has_40_weights():
    assert load_config(find_config("de-best")).search_space.genes == 40


def test_networks_that_are_not_the_papers():
    config = load_config(find_config("robust"))
    assert config.topology == Follower()
    assert config.search_space.genes == 13
    # its genes mean nothing beyond
    assert config.weight_bound == GENE_MAX
    assert config.conditions == Conditions("calibrated", randomise_all=True)
    update = {"network": "feedforward_changes", "hidden": 2, "biases": True}
    changes = config.model_copy(update=update).topology
    assert changes == NetworkWithChanges(2, True)
    assert changes.n_genes == (2 * 8 + 1) * 2 + (2 + 1) * 2


@every_experiment
def test_yaml_round_trip(name, config_file):
    shipped = load_config(find_config(name))
    odd = shipped.model_copy(
        update={
            # values whose YAML spelling is easily read as something else
            "seed": 2**70,
            "robot": "null",
            "arena": "1e3: #",
            "control_step": 1e-5,
            "sensor_range": 0.1 + 0.2,
            "biases": True,
        }
    )
    for config in (shipped, odd):
        text = config.to_yaml()
        back = load_config(config_file(text))
        assert back == config
        assert back.to_yaml() == text


@every_experiment
def test_yaml_holds_every_key_in_the_configs_order(name):
    fields = yaml.safe_load(load_config(find_config(name)).to_yaml())
    assert list(fields) == list(ExperimentConfig.model_fields)
    assert set(fields["optimizer"]) == set(SHIPPED[name])


def test_an_experiment_needs_no_more_than_its_optimizer(config_file):
    config = load_config(config_file({"optimizer": GA}))
    assert config.model_dump() == {**COMMON, "optimizer": PAPERS["ga"]}


def test_unknown_key_is_refused_with_the_available_ones(config_file):
    message = refusal(config_file({"populaton": 3, "optimizer": GA}))
    assert "unknown key 'populaton'" in message
    available = message.partition("available: ")[2].split(", ")
    assert available == list(ExperimentConfig.model_fields)


@pytest.mark.parametrize(
    "optimizer",
    [GA, DE, *BASELINES.values()],
    ids=["ga", "de", *BASELINES],
)
def test_unknown_optimizer_key_is_refused_with_the_available_ones(
    optimizer, config_file
):
    message = refusal(config_file({"optimizer": {**optimizer, "tornament": 3}}))
    assert "unknown key 'optimizer.tornament'" in message
    available = message.partition("available: ")[2].split(", ")
    (known,) = {
        tuple(sorted(keys))
        for keys in SHIPPED.values()
        if keys["algorithm"] == optimizer["algorithm"]
    }
    assert sorted(available) == list(known)


def test_a_key_of_the_other_optimizer_is_unknown(config_file):
    message = refusal(config_file({"optimizer": {**GA, "strategy": "best"}}))
    assert "unknown key 'optimizer.strategy'" in message


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("seed", -1),
        ("seed", "many"),
        ("seed", [1]),
        ("seed", None),
        ("evaluations", 0),
        ("evaluations", 2.5),
        ("robot", 3),
        ("arena", ["arena"]),
        ("trials", 0),
        ("steps", "300 or so"),
        ("steps", 10_000_001),
        ("control_step", 0),
        ("control_step", float("nan")),
        ("fitness", "sum"),
        ("v_max", -0.1),
        ("w_max", float("inf")),
        ("sensor_range", {}),
        ("hidden", 0),
        ("biases", "maybe"),
        ("weight_bound", 0.0),
        ("start_clearance", "wide"),
    ],
)
def test_a_wrong_value_is_refused_by_name_and_shown(key, value, config_file):
    message = refusal(config_file({key: value, "optimizer": GA}))
    assert f"{key}: " in message
    assert message.endswith(f"got {value!r}")


@pytest.mark.parametrize(
    ("optimizer", "words"),
    [
        ({**GA, "bits": "x"}, ("optimizer.bits: ", "'x'")),
        ({**GA, "population": 10.5}, ("optimizer.population: ", "10.5")),
        (
            {**GA, "population": 1},
            ("population: expected a whole number from 2 to 100,000", "1"),
        ),
        ({**GA, "elites": 100}, ("elites: expected 0 to population - 1", "100")),
        ({**DE, "strategy": "bst"}, ("unknown strategy 'bst'", "best, rand")),
        ({**DE, "bounds_rule": "wrap"}, ("unknown bounds rule", "midpoint")),
        (
            {**DE, "scale": float("nan")},
            ("scale: expected a number from 0 to 2", "nan"),
        ),
        ({**DE, "reevaluate_parents": "x"}, ("optimizer.reevaluate_parents: ",)),
        ({"algorithm": "random_search", "population": 0}, ("from 1 to", "got 0")),
        ({"algorithm": "evolution_strategy", "sigma": 0.0}, ("a number above 0",)),
        ({**GA, "bits": "16"}, ("optimizer.bits: ", "got '16'")),
        ({**GA, "bits": True}, ("optimizer.bits: ", "got True")),
        ({**GA, "crossover": "1"}, ("optimizer.crossover: ", "got '1'")),
        ({**DE, "reevaluate_parents": 1}, ("optimizer.reevaluate_parents: ", "got 1")),
        ({**GA, "population": 10**9}, ("population: ", "100,000, got 1000000000")),
        ({**GA, "population": 10**25}, ("population: ", "100,000, got 1000000000")),
        ({**GA, "tournament": 10**9}, ("tournament: ", "10,000, got 1000000000")),
        ({"algorithm": "l_shade", "population": 3}, ("from 4 to", "got 3")),
        ({"algorithm": "l_shade", "p_best": 0}, ("p_best: ", "a number above 0")),
        ({"algorithm": "cma_es", "population": 3}, ("from 4 to", "got 3")),
        ({"algorithm": "cma_es", "restarts": "x"}, ("optimizer.restarts: ", "'x'")),
        ({**GA, "coding": "grey"}, ("unknown coding 'grey'", "binary, gray")),
        ({**GA, "crossover_points": 3}, ("crossover_points: ", "from 1 to 2, got 3")),
        ({**DE, "reevaluate_best": 11}, ("expected 0 to population = 10", "got 11")),
        (
            {**DE, "reevaluate_best": 1, "reevaluate_parents": True},
            ("expected 0 together with reevaluate_parents", "got 1"),
        ),
        ({"algorithm": "openai_es", "pairs": 0}, ("pairs: ", "from 1 to", "got 0")),
        ({"algorithm": "ssshc", "stochasticity": 2}, ("from 0 to 1", "got 2")),
        ({"algorithm": "cma"}, (EVERY_ALGORITHM, "cma")),
        ({"algorithm": ["cma_es"]}, (EVERY_ALGORITHM, "['cma_es']")),
        ({"bits": 8}, (EVERY_ALGORITHM,)),
        ("ga", (EVERY_ALGORITHM, "'ga'")),
        (None, (EVERY_ALGORITHM, "None")),
        ({"algorithm": "differential_evolution"}, ("'optimizer.strategy' is missing",)),
    ],
)
def test_a_wrong_optimizer_is_refused(optimizer, words, config_file):
    message = refusal(config_file({"optimizer": optimizer}))
    for word in words:
        assert word in message


def test_everything_wrong_is_named_at_once(config_file):
    message = refusal(
        config_file({"trials": 0, "stpes": 3, "optimizer": {**GA, "bits": "x"}})
    )
    for word in ("trials: ", "unknown key 'stpes'", "optimizer.bits: "):
        assert word in message


def test_missing_optimizer_is_refused(config_file):
    assert "key 'optimizer' is missing" in refusal(config_file({"seed": 3}))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("seed: [1\n", "is not YAML"),
        ("seed: 1\n\tsteps: 2\n", "is not YAML"),
        ("!!python/object/apply:os.getcwd []\n", "is not YAML"),
        (b"\xff\xfe\x00", "cannot read"),
        ("", "expected a mapping of keys to values, got NoneType"),
        ("- seed\n", "expected a mapping of keys to values, got list"),
        ("just words\n", "expected a mapping of keys to values, got str"),
    ],
)
def test_what_is_no_mapping_is_refused(content, words, config_file):
    assert words in refusal(config_file(content))


def test_a_number_of_a_thousand_digits_is_refused(config_file):
    assert "is not YAML" in refusal(config_file(f"seed: {'1' * 5000}\n"))


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    refusal(tmp_path / "missing.yaml")
    refusal(tmp_path)


def test_unknown_experiment_is_refused_with_the_shipped_ones(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    available = ", ".join(ALL)
    with pytest.raises(UserError, match=rf"no experiment 'de'.* one of {available}$"):
        find_config("de")
    with pytest.raises(UserError, match="no experiment"):
        find_config(".")


@pytest.mark.parametrize(
    ("evolution", "expected"),
    [
        (None, "evolution: expected a mapping with 'algorithm'"),
        ({"algorithm": "ga"}, "one of differential_evolution, got 'ga'"),
        ({"scal": 1.0}, "evolution: unknown key 'scal'; available: strategy, popul"),
        ({"population": "many"}, "evolution: population: expected a whole number"),
        ({"population": 2}, "population: expected a whole number from 4 to "),
    ],
)
def test_a_part_of_an_optimizer_is_checked(evolution, expected):
    fields = load_config(find_config("memetic-de")).model_dump()
    part = fields["optimizer"]["evolution"]
    changed = {} if evolution is None else part | evolution
    fields["optimizer"]["evolution"] = changed
    with pytest.raises(UserError) as refused:
        ExperimentConfig.parsed(fields, "mine")
    message = str(refused.value)
    assert expected in message
    # what came is said of the part, not of all around it
    assert "differential_evolution', " not in message
    assert message.count(", got ") <= 1


@pytest.mark.parametrize("name", [*HYBRIDS, "policy-gradient", "best"])
def test_hybrids_come_back_from_their_yaml(name):
    config = load_config(find_config(name))
    assert ExperimentConfig.from_yaml(config.to_yaml(), "mine") == config
    assert config.budget == 150_000


def test_an_own_file_is_found_by_its_path(config_file):
    path = config_file({"optimizer": GA})
    assert find_config(str(path)) == path


@every_experiment
def test_frozen(name):
    config = load_config(find_config(name))
    with pytest.raises(ValidationError, match="frozen"):
        config.seed = 3  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(FrozenInstanceError):
        config.optimizer.algorithm = "x"  # pyright: ignore[reportAttributeAccessIssue]


def test_a_changed_copy_leaves_the_original_alone():
    config = load_config(find_config("ga"))
    changed = config.model_copy(
        update={"optimizer": replace(config.optimizer, population=9)}
    )
    assert changed.optimizer != config.optimizer
    assert config == load_config(find_config("ga"))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("evaluations", "true"),
        ("trials", "'5'"),
        ("seed", "2.0"),
        ("control_step", "'0.1'"),
        ("v_max", "false"),
        ("evaluations", "1e5"),
    ],
)
def test_a_value_of_another_type_is_not_converted(key, value, config_file):
    text = (CONFIGS / "ga.yaml").read_text().replace("trials: 5\n", "")
    text = text.replace("evaluations: 30000\n", "")
    text = text.replace("control_step: 0.1\n", "")
    kind = "a number" if key in ("control_step", "v_max") else "a whole number"
    assert f"{key}: expected {kind} " in refusal(config_file(f"{key}: {value}\n{text}"))


def test_a_boolean_is_true_or_false(config_file):
    text = (CONFIGS / "ga.yaml").read_text()
    for value in ("'yes'", "1"):
        message = refusal(config_file(f"biases: {value}\n{text}"))
        assert "biases: Input should be a valid boolean" in message


@pytest.mark.parametrize(
    ("key", "value", "most"),
    [
        ("control_step", 1e9, "10 s"),
        ("hidden", 10**9, "1,000"),
        ("hidden", 10**21, "1,000"),
        ("trials", 10**9, "100,000"),
        ("evaluations", 10**9, "100,000,000"),
        ("test_starts", 10**9, "100,000"),
        ("v_max", 128.8, "0.13 m/s (speeds are metres a second)"),
        ("w_max", 278.0, "5 rad/s"),
        ("sensor_range", 40.0, "1 m (lengths are metres)"),
        ("start_clearance", 10.0, "1 m (lengths are metres)"),
        ("weight_bound", 1e308, "1,000,000"),
    ],
)
def test_beyond_its_limit_a_key_is_refused_with_it(key, value, most, config_file):
    message = refusal(config_file({key: value, "optimizer": GA}))
    assert f"{key}: expected " in message
    assert f" {most}, got " in message
