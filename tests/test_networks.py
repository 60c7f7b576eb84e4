"""All shipped networks: the same bits alone, in crowds, compiled and in files."""

import json

import numpy as np
import pytest

from epuck_mj.bridge.drive.order import champion
from epuck_mj.errors import UserError
from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.file import ControllerFile, Origin, load_controller
from epuck_mj.policies.network import Controller, Network
from epuck_mj.policies.topology import FEEDFORWARD, NETWORKS, Topology, topology_from
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.kinematic.drivers import drivers_of
from epuck_mj.rungs.kinematic.fused import FusedTrials
from epuck_mj.rungs.kinematic.robots import KinematicRobots
from epuck_mj.rungs.kinematic.whole_trial import FITNESS
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import Everybody, TaskParameters, run_trials, started
from epuck_mj.step.motors import Speeds
from epuck_mj.trials.recorder import record, record_trajectories
from evolution.evaluate import evaluate_policies
from evolution.judging.evaluation import BatchEngine, DmControlEngine, Work, evaluate
from evolution.run.__main__ import evolve
from tests.no_pictures import draw_nothing

SHAPES = [(4, False), (1, True), (7, True)]
SPEEDS = Speeds(0.08, 2.0)
TASK = TaskParameters(steps=60, sensor_range=0.06, speeds=SPEEDS)


@pytest.fixture(scope="module", params=NETWORKS)
def topology(request) -> Topology:
    return NETWORKS[request.param](4, False)


@pytest.fixture(scope="module")
def square() -> Scene:
    return load_scene("epuck_kinematic", "arena")


def genomes_for(topology: Topology, n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform(-5, 5, (n, topology.n_genes))


def starts_in(scene: Scene, n: int) -> np.ndarray:
    return FreeSpace(scene, 0.003).sample(np.random.default_rng(0), n)


def same(one, other) -> None:
    np.testing.assert_array_equal(one.fitness, other.fitness)
    np.testing.assert_array_equal(one.steps, other.steps)
    np.testing.assert_array_equal(one.crashed, other.crashed)


@pytest.mark.parametrize("fitness", FITNESS)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", NETWORKS)
def test_compiled_trials_have_the_bits_of_the_loop(square, name, shape, fitness):
    topology, n = NETWORKS[name](*shape), 40
    task = TaskParameters(60, fitness=fitness, sensor_range=0.06, speeds=SPEEDS)
    genomes, starts = genomes_for(topology, n), starts_in(square, n)
    rng = np.random.default_rng(2)
    for met in (None, Conditions("strong", True).draw(rng, n, task.steps)):
        compiled = FusedTrials(square, task, 2)
        policy = topology.decode(genomes)
        assert isinstance(policy, Controller | WithChanges)
        found = compiled(policy, starts, met, 1, np.full(n, -np.inf))
        robots = disturbed(KinematicRobots(square, n), met, task.control_step)
        expected = run_trials(robots, topology.decode(genomes), starts, task)
        same(found, expected)
        assert len(set(expected.fitness.tolist())) > n // 4


def test_the_engine_compiles_them_and_races_them(square, topology, monkeypatch):
    def refused(*_):
        raise AssertionError("step by step")

    monkeypatch.setattr("evolution.judging.evaluation.run_trials", refused)
    engine, genomes = BatchEngine(square, TASK, 1), genomes_for(topology, 30)
    starts = starts_in(square, 3)
    free = evaluate(engine, topology, genomes, starts)
    to_beat = np.full(30, np.median(free.fitness))
    raced = evaluate(engine, topology, genomes, starts, to_beat)
    won = free.fitness >= to_beat
    np.testing.assert_array_equal(raced.fitness[won], free.fitness[won])
    assert (raced.fitness[~won] < to_beat[~won]).all()


def test_other_policies_are_not_compiled():
    with pytest.raises(TypeError, match="expected a network or a follower"):
        drivers_of(Everybody(lambda seen: seen))  # pyright: ignore[reportArgumentType]


def test_engines_agree_to_the_last_bit_on_wheels(wheels, topology):
    task = TaskParameters(20, speeds=SPEEDS)
    genomes, starts = genomes_for(topology, 4), starts_in(wheels, 3)
    batch = evaluate(BatchEngine(wheels, task), topology, genomes, starts)
    single = evaluate(DmControlEngine(wheels, task), topology, genomes, starts)
    np.testing.assert_array_equal(batch.trial_fitness, single.trial_fitness)
    np.testing.assert_array_equal(batch.steps, single.steps)


def test_a_robot_acts_the_same_alone_and_in_a_crowd(topology):
    rng, genomes = np.random.default_rng(1), genomes_for(topology, 37)
    crowd, some = topology.decode(genomes), topology.decode(genomes)[::3]
    alone = [started(topology.decode(genome), None) for genome in genomes[::3]]
    one_of_many = Everybody(topology.decode(genomes[0])).started(5)
    stay = np.array([True, False, False, True, False])
    for k in range(6):
        seen = rng.random((37, 8))
        action = crowd(seen)
        assert ((action[:, 0] >= 0) & (np.abs(action).max(axis=-1) <= 1)).all()
        np.testing.assert_array_equal(some(seen[::3]), action[::3])
        each = [policy(own) for policy, own in zip(alone, seen[::3], strict=True)]
        np.testing.assert_array_equal(each, action[::3])
        # one controller in many robots, of which some leave
        n = 5 if k < 3 else 2
        many = one_of_many(np.tile(seen[0], (n, 1)))
        np.testing.assert_array_equal(many, np.tile(action[0], (n, 1)))
        if k == 2:
            one_of_many = one_of_many[stay]


def test_a_start_forgets(topology):
    seen = np.random.default_rng(3).random((3, 6, 8))
    policy = topology.decode(genomes_for(topology, 6))
    first = [policy(each) for each in seen]
    again = started(policy, 6)
    np.testing.assert_array_equal([again(each) for each in seen], first)


def test_memory_is_not_the_caller_s(topology):
    seen = np.random.default_rng(4).random((2, 6, 8))
    genomes = genomes_for(topology, 6)
    one, other = topology.decode(genomes), topology.decode(genomes)
    shared = seen[0].copy()
    one(shared)
    other(seen[0])
    shared[:] = seen[1]
    np.testing.assert_array_equal(one(shared), other(seen[1]))


def test_genomes_of_another_length_are_refused(topology):
    n = topology.n_genes
    with pytest.raises(
        ValueError, match=f"expected genomes of {n} genes for .*{n + 1}"
    ):
        topology.decode(np.zeros((2, n + 1)))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", NETWORKS)
def test_champion_files_come_back_bit_for_bit(tmp_path, name, shape):
    topology = NETWORKS[name](*shape)
    genome = genomes_for(topology, 1)[0]
    path, origin = tmp_path / "champion.json", Origin("epuck", "arena")
    path.write_text(ControllerFile(topology, genome, TASK, origin, {}).to_json())
    back = load_controller(path)
    assert back.network == topology
    policy = topology.decode(genome)
    for seen in np.random.default_rng(5).random((4, 8)):
        np.testing.assert_array_equal(
            back.controller(seen), topology.decode(genome)(seen)
        )
        policy(seen)


@pytest.mark.parametrize(
    ("network", "expected"),
    [
        ({"follower": {}}, "as in this version"),
        ({"follower": {"near": [0, 1]}, "hidden": 4}, "as in this version"),
        ({"changes": True, "hidden": 0, "biases": False}, "hidden"),
        ({"changes": 1, "hidden": 4, "biases": False}, "changes"),
    ],
)
def test_files_of_no_network_are_refused(tmp_path, network, expected):
    origin = Origin("epuck", "arena")
    file = ControllerFile(Network(), np.zeros(40), TASK, origin, {})
    path = tmp_path / "champion.json"
    path.write_text(json.dumps(json.loads(file.to_json()) | {"network": network}))
    with pytest.raises(UserError, match="is not a controller file") as error:
        load_controller(path)
    assert expected in str(error.value)


def test_names_of_networks():
    assert list(NETWORKS) == [FEEDFORWARD, "feedforward_changes", "follower"]
    assert [make(4, False).n_genes for make in NETWORKS.values()] == [40, 72, 13]
    for make in NETWORKS.values():
        topology = make(3, True)
        assert topology_from(json.loads(json.dumps(topology.to_dict()))) == topology


def test_recordings_have_what_the_policy_did(square, topology):
    """Actions, and outputs of hidden neurons, computed from what was seen."""
    genome, start = genomes_for(topology, 1)[0], starts_in(square, 1)[0]
    trajectory = record(square, topology.decode(genome), start, TASK)
    policy, observation = topology.decode(genome), trajectory.observation
    for k in range(trajectory.steps):
        np.testing.assert_array_equal(policy(observation[k]), trajectory.action[k])
    if not trajectory.hidden.size:
        return
    weights = policy.reflex if hasattr(policy, "reflex") else policy
    for k in range(trajectory.steps):
        change = observation[k] - observation[max(k - 1, 0)]
        seen = np.concatenate([observation[k], change])[: weights.hidden.shape[0]]
        np.testing.assert_array_equal(trajectory.hidden[k], weights.activation(seen))


def test_recordings_are_the_trials_of_evolution(square, topology):
    genome, starts = genomes_for(topology, 1, seed=2), starts_in(square, 5)
    trials = evaluate(BatchEngine(square, TASK, 1), topology, genome, starts)
    policy = topology.decode(genome[0])
    recorded = record_trajectories(square, policy, starts, TASK)
    fitness = [each.trial_fitness for each in recorded]
    np.testing.assert_array_equal(fitness, trials.trial_fitness[0])
    work = Work(Everybody(policy), starts)
    np.testing.assert_array_equal(BatchEngine(square, TASK).run(work).fitness, fitness)


def test_a_run_is_the_same_on_any_engine_and_its_champion_drives(
    topology, tmp_path, monkeypatch, capsys
):
    """Evolution, files, tests and a robot's session."""
    monkeypatch.chdir(tmp_path)
    draw_nothing(monkeypatch)
    name = next(key for key, make in NETWORKS.items() if make(4, False) == topology)
    flags = (
        f"robust --network {name} --evaluations 60 --steps 15 --trials 2 "
        "--validation-starts 5 --test-starts 5"
    )
    for ideal, ways in (
        ("", ("--threads 1", "--no-racing --threads 2")),
        (
            "--noise none --no-randomise-all --robot epuck ",
            ("--threads 1", "--engine dm_control"),
        ),
    ):
        for i, way in enumerate(ways):
            assert evolve(f"{flags} {ideal}{way} --output {i}{len(ideal)}".split()) == 0
        for file in ("history.csv", "champion.json"):
            one, other = (tmp_path / f"{i}{len(ideal)}" / file for i in range(2))
            assert one.read_bytes() == other.read_bytes()
    assert "not compiled" not in capsys.readouterr().err
    assert evaluate_policies(["00", "--starts", "3", "--noise", "calibrated"]) == 0
    assert "3 starts" in capsys.readouterr().out
    driver = champion(str(tmp_path / "00"))
    assert driver.task.sensor_range == 0.06
    action = started(driver.policy, None)(np.full(8, 0.5))
    assert action.shape == (2,)


@pytest.mark.parametrize("hidden", [1, 5])
@pytest.mark.parametrize("biases", [False, True])
def test_without_weights_of_changes_it_is_the_network(hidden, biases):
    changes, plain = (
        NETWORKS["feedforward_changes"](hidden, biases),
        Network(hidden, biases),
    )
    genome = genomes_for(plain, 1)[0]
    n_in = 8 + biases
    into, out = np.split(genome, [n_in * hidden])
    into = into.reshape(hidden, n_in)
    wide = np.concatenate([into[:, :8], np.zeros((hidden, 8)), into[:, 8:]], axis=1)
    policy = changes.decode(np.concatenate([wide.ravel(), out]))
    for seen in np.random.default_rng(6).random((5, 8)):
        np.testing.assert_array_equal(policy(seen), plain.decode(genome)(seen))
