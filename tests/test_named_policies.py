"""Policies by name: champions, past generations, the follower written by hand."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.step.control import TaskParameters
from evolution.judging.scores import KnownScores
from evolution.named_policies import NamedPolicy, described, named_policies
from evolution.replay.trials import labels
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config

GENERATIONS = 3


@pytest.fixture(scope="module")
def evolved(tmp_path_factory) -> Path:
    """A run that has evolved and not yet chosen its champion."""
    fields = load_config(find_config("ga")).model_dump()
    fields |= {"evaluations": 10 * GENERATIONS, "steps": 15, "trials": 2}
    fields |= {"validation_starts": 10, "test_starts": 30}
    fields["start_clearance"] = 0.03
    fields["optimizer"]["population"] = 10
    path = tmp_path_factory.mktemp("study") / "ga" / "seed-1"
    run = Run(ExperimentConfig.parsed(fields, "ga"), RunDirectory(path), Means(), ())
    run.start()
    assert len(list(run.evolve())) == GENERATIONS
    return path


@pytest.fixture
def copy(evolved, tmp_path) -> Path:
    """To be damaged."""
    return Path(shutil.copytree(evolved, tmp_path / "run"))


def of_a_person(folder: Path, scores: dict) -> NamedPolicy:
    """The policy of a controller file with those scores."""
    path = champion(folder / "a.json")
    path.write_text(json.dumps(json.loads(path.read_text()) | {"scores": scores}))
    (policy,) = named_policies(str(path))
    return policy


def champion(path: Path, robot: str = "epuck_kinematic") -> Path:
    """A controller file of a first gene 1."""
    genome = np.eye(Network().n_genes)[0]
    task, origin = TaskParameters(steps=7), Origin(robot, "round")
    file = ControllerFile(Network(), genome, task, origin, {"stored": 3.5})
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(file.to_json())
    return path


def refused(*arguments) -> str:
    with pytest.raises(UserError) as error:
        named_policies(*arguments)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_the_follower_written_by_hand():
    (policy,) = named_policies("wall-follower")
    assert isinstance(policy.policy, WallFollower)
    assert (policy.name, policy.arena, policy.task) == (
        "wall-follower",
        "arena",
        TaskParameters(),
    )


def test_a_controller_file_says_what_it_is_for(tmp_path):
    path = champion(tmp_path / "a.json", "epuck")
    (policy,) = named_policies(str(path))
    assert (policy.robot, policy.arena, policy.task.steps) == ("epuck", "round", 7)
    assert policy.scores == KnownScores(stored=3.5)
    assert policy.config is None
    assert policy.policy(np.ones(8)).tolist() == pytest.approx([0.5, 0])


def test_a_study_is_all_its_champions_in_order(tmp_path):
    names = ["ga/seed-10", "ga/seed-2", "de/seed-1"]
    for name in names:
        champion(tmp_path / name / "champion.json")
    policies = named_policies(str(tmp_path))
    assert [policy.source for policy in policies] == [
        str(tmp_path / name) for name in reversed(names)
    ]
    assert len({policy.name for policy in policies}) == 3


def test_generations_are_the_best_individuals_of_a_run_that_goes_on(evolved):
    config = load_config(evolved / "config.yaml")
    checkpoint = files.read_arrays(evolved / "checkpoint.npz")
    policies = named_policies(str(evolved), "2, 0,last,0")
    # each once, in the order asked for
    assert [policy.variant for policy in policies] == ["generation 2", "generation 0"]
    for policy, generation in zip(policies, (2, 0), strict=True):
        expected = config.topology.decode(checkpoint["best_genomes"][generation])
        seen = np.linspace(0, 1, 8)
        np.testing.assert_array_equal(policy.policy(seen), expected(seen))
        stored = checkpoint["records"][generation, 2]
        assert policy.scores == KnownScores(stored=stored)
        assert policy.task.steps == 15
        assert policy.start_clearance == 0.03
        assert policy.config == config
        assert policy.name == f"{evolved} generation {generation}"


@pytest.mark.parametrize(
    "generations",
    ["", "3", "-1", "0,3", "first", "0-2", "1.5", "0,,1", "LAST", "²", "9" * 5000],
    ids=range(11),
)
def test_generations_that_are_not_there_are_one_line(evolved, generations):
    message = refused(str(evolved), generations)
    assert message.startswith("expected generations from 0 to 2 or last, with commas")
    assert generations in message


@pytest.mark.parametrize("path", ["wall-follower", "no where", ".", "a" * 300, "\0"])
def test_only_runs_have_generations(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "expected a run that has saved its generations" in refused(path, "0")


def test_a_run_that_has_saved_none_is_refused(copy):
    (copy / "best_individuals.npz").unlink()
    message = refused(str(copy), "last")
    assert "best_individuals.npz': expected a run that has saved" in message


@pytest.mark.parametrize(
    "arrays",
    [
        {},
        {"fitness": np.ones(3)},
        {"genomes": np.ones((3, 40))},
        {"genomes": np.ones((3, 40)), "fitness": np.ones(2)},
        {"genomes": np.ones((3, 39)), "fitness": np.ones(3)},
        {"genomes": np.ones((0, 40)), "fitness": np.ones(0)},
        {"genomes": np.ones((3, 40)), "fitness": np.float64(3)},
        {"genomes": np.float64(3), "fitness": np.ones(3)},
        {"genomes": np.ones((3, 40)), "fitness": np.array(["a", "b", "c"])},
        {"genomes": np.full((3, 40), "a"), "fitness": np.ones(3)},
        {"genomes": np.full((3, 40), np.nan), "fitness": np.ones(3)},
        {"genomes": np.ones((3, 40), complex), "fitness": np.ones(3)},
    ],
    ids=range(12),
)
def test_best_individuals_of_something_else_are_one_line(copy, arrays):
    files.write_arrays(copy / "best_individuals.npz", arrays)
    assert "best_individuals.npz': expected " in refused(str(copy), "0")


@pytest.mark.parametrize("length", [0, 1, 100, -1])
def test_truncated_best_individuals_are_one_line(copy, length):
    path = copy / "best_individuals.npz"
    path.write_bytes(path.read_bytes()[:length])
    assert f"cannot read '{path}'" in refused(str(copy), "0")


@pytest.mark.parametrize(
    "path", ["nowhere", ".", "a" * 300, "a/" * 3000, "\0"], ids=range(5)
)
def test_where_no_champion_is(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert refused(path).startswith(f"no champion in '{path}': expected ")


def test_an_unfinished_run_has_no_champion_yet(evolved):
    assert "expected the directory of a finished run" in refused(str(evolved))


def test_a_damaged_controller_is_one_line(tmp_path):
    path = champion(tmp_path / "a.json")
    path.write_text(path.read_text().replace('"arena"', '"place"'))
    assert "does not say which arena" in refused(str(path))


def test_labels_are_short_and_tell_apart():
    def named(*names):
        return labels(
            [NamedPolicy(source, WallFollower(), TaskParameters(), variant=variant)
             for source, variant in names]
        )  # fmt: skip

    assert labels([]) == []
    assert named(("wall-follower", "")) == ["wall-follower"]
    assert named(("runs/study/ga/seed-1", "")) == ["ga/seed-1"]
    # one run: its generations are enough
    assert named(("runs/ga", "generation 0"), ("runs/ga", "generation 9")) == [
        "generation 0",
        "generation 9",
    ]
    assert named(("runs/ga", "generation 0"), ("runs/de", "generation 0")) == [
        "runs/ga generation 0",
        "runs/de generation 0",
    ]
    # ends that are the same tell nothing
    assert named(("a/ga/seed-1", ""), ("b/ga/seed-1", "")) == [
        "a/ga/seed-1",
        "b/ga/seed-1",
    ]


def test_what_is_known_of_a_policy_is_described(evolved, tmp_path):
    text = described(named_policies(str(evolved), "1")[0])
    assert text.startswith(f"## {evolved} generation 1\n")
    assert "from its trials in evolution: " in text
    assert load_config(evolved / "config.yaml").to_yaml() in text
    held_out = {
        "epuck": {"mean": 212.25, "starts": 1000, "crash_rate": 0.125},
    }
    text = described(of_a_person(tmp_path, {"held_out": held_out}))
    assert "- Held-out fitness, epuck: 212.2 over 1,000 starts, 12.5% crash" in text
    assert "arena: round" in text
    assert "Stored" not in text


@pytest.mark.parametrize("scores", [{}, {"note": "the best"}], ids=str)
def test_of_unknown_scores_nothing_is_said(tmp_path, scores):
    policy = of_a_person(tmp_path, scores)
    assert policy.scores == KnownScores()
    assert described(policy).startswith(f"## {policy.name}\n\n\n```\n")


@pytest.mark.parametrize(
    "scores",
    [
        {"stored": "no"},
        {"stored": None, "validation": True},
        {"stored": float("nan")},
        {"held_out": 3},
        {"held_out": [1]},
        {"held_out": {"epuck": {"mean": 3.0}}},
        {"held_out": {"epuck": {"mean": 3.0, "crash_rate": 0.1, "starts": "9"}}},
    ],
    ids=str,
)
def test_false_scores_are_refused(tmp_path, scores):
    with pytest.raises(UserError, match=r"a\.json'"):
        of_a_person(tmp_path, scores)


def test_scores_that_are_known_are_said_beside_unknown_ones(tmp_path):
    text = described(of_a_person(tmp_path, {"stored": 240}))
    assert "- Stored fitness, from its trials in evolution: 240.0\n" in text
    assert "validation" not in text
