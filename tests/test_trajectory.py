"""Trajectories: what is recorded is what happened, and comes back from its file."""

import dataclasses
import io
import zipfile

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import RUNGS, robots_in
from epuck_mj.scene.model import load_scene
from epuck_mj.step.control import TaskParameters, run_trials
from epuck_mj.step.fitness import FORMULAS
from epuck_mj.step.motors import command
from epuck_mj.step.sensors import observe, proximity
from epuck_mj.trials.recorder import record
from epuck_mj.trials.trajectory import Trajectory

TASK = TaskParameters(steps=60)
STARTS = np.array([[0.0, 0.0, 0.0], [0.42, 0.1, 0.4], [-0.2, -0.44, 3.0]])
FIELDS = [field.name for field in dataclasses.fields(Trajectory)]


@pytest.fixture(scope="module", params=RUNGS)
def scene(request):
    return load_scene(request.param, "arena", TASK.control_step)


def genome(seed):
    return np.random.default_rng(seed).uniform(-5, 5, Network().n_genes)


def straight_on(observation):
    """Full speed ahead, whatever comes: a crash for sure."""
    action = np.zeros((*observation.shape[:-1], 2))
    action[..., 0] = 1.0
    return action


def equal(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in FIELDS)


@pytest.mark.parametrize("seed", range(4))
def test_fitness_is_that_of_run_trials_to_the_last_bit(scene, seed):
    genomes = np.stack([genome(seed)] * len(STARTS))
    controllers = Network().decode(genomes)
    robots = robots_in(scene, len(STARTS), 1)
    trials = run_trials(robots, controllers, STARTS, TASK)
    for i, start in enumerate(STARTS):
        trajectory = record(scene, controllers[i], start, TASK)
        assert trajectory.trial_fitness == trials.fitness[i]
        assert trajectory.steps == trials.steps[i]
        assert trajectory.crashed == trials.crashed[i]


def test_rows_are_the_steps_of_one_trial(scene):
    controller = Network().decode(genome(1))
    trajectory = record(scene, controller, STARTS[1], TASK)
    seen, steps = trajectory.observation, trajectory.steps
    np.testing.assert_allclose(trajectory.pose[0], STARTS[1], atol=1e-12)
    np.testing.assert_array_equal(
        trajectory.time, np.arange(steps + 1) * TASK.control_step
    )
    np.testing.assert_array_equal(seen, observe(trajectory.distance, TASK.sensor_range))
    counts = np.rint(proximity(trajectory.distance))
    np.testing.assert_array_equal(trajectory.proximity, counts)
    for k in range(steps):
        np.testing.assert_array_equal(trajectory.action[k], controller(seen[k]))
    np.testing.assert_array_equal(
        trajectory.command, command(trajectory.action, TASK.speeds)
    )
    fitness = FORMULAS[TASK.fitness](trajectory.action, seen[1:])
    fitness[trajectory.contact[1:]] = 0
    np.testing.assert_array_equal(trajectory.fitness, fitness)


@pytest.mark.parametrize("hidden", [1, 4, 7])
def test_hidden_is_what_the_hidden_neurons_put_out(scene, hidden):
    network = Network(hidden, biases=True)
    genome = np.random.default_rng(0).uniform(-5, 5, network.n_genes)
    controller = network.decode(genome)
    trajectory = record(scene, controller, STARTS[1], TASK)
    assert trajectory.hidden.shape == (trajectory.steps, hidden)
    for k in range(trajectory.steps):
        alone = controller.activation(trajectory.observation[k])
        np.testing.assert_array_equal(trajectory.hidden[k], alone)
    assert np.ptp(trajectory.hidden) > 0


@pytest.mark.parametrize("policy", [straight_on, WallFollower()], ids=["line", "wall"])
def test_a_policy_without_neurons_has_none(scene, policy, tmp_path):
    trajectory = record(scene, policy, STARTS[1], TASK)
    assert trajectory.hidden.shape == (trajectory.steps, 0)
    trajectory.save(tmp_path / "trial.npz")
    assert equal(Trajectory.load(tmp_path / "trial.npz"), trajectory)


def test_a_crash_ends_the_trial_and_is_its_last_row(scene):
    trajectory = record(scene, straight_on, STARTS[1], TASK)
    assert trajectory.crashed
    assert trajectory.steps < TASK.steps
    assert not trajectory.contact[:-1].any()
    assert trajectory.fitness[-1] == 0


def test_a_trial_without_crash_lasts_all_steps(scene):
    task = dataclasses.replace(TASK, steps=5)
    trajectory = record(scene, straight_on, STARTS[0], task)
    assert (trajectory.steps, trajectory.crashed) == (5, False)
    assert trajectory.cumulative_fitness.shape == (5,)


def test_file_gives_the_trajectory_back_in_equal_bytes(scene, tmp_path, monkeypatch):
    trajectory = record(scene, straight_on, STARTS[1], TASK)
    first, second = tmp_path / "first.npz", tmp_path / "second.other"
    trajectory.save(first)
    # a zip archive holds times: they must not be today's
    monkeypatch.setattr("time.time", lambda: 2e9)
    trajectory.save(str(second))
    assert equal(Trajectory.load(first), trajectory)
    assert equal(Trajectory.load(str(second)), trajectory)
    assert first.read_bytes() == second.read_bytes()
    assert sorted(tmp_path.iterdir()) == [first, second]


def test_motor_steps_are_kept_if_there_are_any(scene, tmp_path):
    trajectory = record(scene, straight_on, STARTS[1], TASK)
    assert trajectory.motor_steps is None
    steps = np.arange(2.0 * trajectory.time.size).reshape(-1, 2)
    dataclasses.replace(trajectory, motor_steps=steps).save(tmp_path / "robot.npz")
    loaded = Trajectory.load(tmp_path / "robot.npz").motor_steps
    assert loaded is not None
    np.testing.assert_array_equal(loaded, steps)


def _with_another_header(content):
    """An archive whose arrays have damaged headers under good checksums."""
    damaged = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(content)) as archive,
        zipfile.ZipFile(damaged, "w") as copy,
    ):
        for name in archive.namelist():
            array = archive.read(name)
            assert b"'descr'" in array
            copy.writestr(name, array.replace(b"'descr'", b"'desk\n'"))
    return damaged.getvalue()


def test_a_trajectory_of_a_whole_trial_is_a_small_file(scene, tmp_path):
    trajectory = record(scene, WallFollower(), STARTS[0], TaskParameters(steps=300))
    trajectory.save(tmp_path / "trial.npz")
    arrays = [getattr(trajectory, name) for name in FIELDS]
    numbers = sum(array.nbytes for array in arrays if array is not None)
    assert (tmp_path / "trial.npz").stat().st_size < numbers / 2


def test_files_that_are_none_are_refused_in_one_line(scene, tmp_path):
    path = tmp_path / "trial.npz"
    record(scene, straight_on, STARTS[1], TASK).save(path)
    content = path.read_bytes()
    contents = [content[:length] for length in (0, 1, 50, 500, len(content) - 1)]
    contents += [b"no archive", _with_another_header(content)]
    for damaged in contents:
        path.write_bytes(damaged)
        with pytest.raises(UserError, match=r"trial\.npz") as error:
            Trajectory.load(path)
        assert "\n" not in str(error.value)


def test_other_arrays_are_refused(scene, tmp_path):
    path = tmp_path / "other.npz"
    trajectory = record(scene, straight_on, STARTS[1], TASK)
    arrays = {name: getattr(trajectory, name) for name in FIELDS}
    # of real robots only
    del arrays["motor_steps"]
    name = np.array("epuck_mj.trajectory/2")
    for foreign, message in [
        (arrays, "expected format"),
        (
            arrays | {"format": np.array("epuck_mj.trajectory/1")},
            "expected format",
        ),
        ({"format": name, "time": arrays["time"]}, "missing"),
        (arrays | {"format": name, "more": name}, "more"),
        (arrays | {"format": name, "pose": arrays["pose"][:-1]}, "expected pose"),
        (arrays | {"format": name, "contact": arrays["time"]}, "expected contact"),
        (arrays | {"format": name, "motor_steps": arrays["time"]}, "motor_steps"),
        (arrays | {"format": name, "hidden": arrays["time"]}, "expected hidden"),
        (arrays | {"format": name, "hidden": np.float64(1)}, "expected hidden"),
        (
            arrays | {"format": name, "proximity": arrays["distance"][1:]},
            "expected proximity",
        ),
    ]:
        np.savez(path, **foreign)
        with pytest.raises(UserError, match=message):
            Trajectory.load(path)
    single = tmp_path / "single.npy"
    np.save(single, arrays["time"])
    with pytest.raises(UserError, match=r"expected an \.npz archive"):
        Trajectory.load(single)
    with pytest.raises(UserError, match=r"nothing\.npz"):
        Trajectory.load(tmp_path / "nothing.npz")


def test_a_folder_that_is_not_there_is_the_users_error(scene, tmp_path):
    trajectory = record(scene, straight_on, STARTS[1], TASK)
    with pytest.raises(UserError, match="cannot write"):
        trajectory.save(tmp_path / "nowhere" / "trial.npz")


def test_arrays_that_do_not_belong_together_are_refused(scene):
    trajectory = record(scene, straight_on, STARTS[1], TASK)
    with pytest.raises(ValueError, match="expected action"):
        dataclasses.replace(trajectory, action=trajectory.action[:-1])
