"""PPO beside evolution: its network is one's own, its curve is drawn beside theirs."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.ppo import CURVE
from benchmarks.ppo.figure import EXPERIMENT, comparison, figure_of, growth
from benchmarks.ppo.network import LAYERS, Tanh, genome_of
from epuck_mj.policies.file import CHAMPION, ControllerFile, Origin
from epuck_mj.policies.topology import OwnNetwork, check_network
from epuck_mj.step.control import TaskParameters
from evolution.frames import Study

ROOT = Path(__file__).parent.parent
NETWORK = "benchmarks.ppo.network:Tanh"
LOOKS = [
    {"steps": 0, "seconds": 0.0, "fitness": 0.0, "crash_rate": 1.0},
    {"steps": 3_000_000, "seconds": 6.0, "fitness": 80.0, "crash_rate": 0.1},
]


def layers(seed=0):
    rng = np.random.default_rng(seed)
    return [(rng.normal(size=(o, i)), rng.normal(size=o)) for i, o in LAYERS]


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_the_network_is_what_it_is_said_to_be():
    weights = layers()
    observation = np.random.default_rng(1).random((5, 8))
    values = observation
    for weight, bias in weights[:-1]:
        values = np.tanh(values @ weight.T + bias)
    expected = values @ weights[-1][0].T + weights[-1][1]
    genome = genome_of(weights)
    assert genome.shape == (Tanh.n_genes,) == (4866,)
    action, state = Tanh().act(genome, observation, np.zeros((5, 0)))
    np.testing.assert_allclose(action, np.clip(expected, (0, -1), (1, 1)), atol=1e-12)
    assert state.shape == (5, 0)
    # some are cut
    assert (np.abs(action - expected) > 0.1).any()


def test_a_robot_acts_the_same_alone_as_among_others():
    check_network(NETWORK)


def test_its_controller_file_can_be_replayed(tmp_path):
    file = ControllerFile(
        OwnNetwork(NETWORK),
        genome_of(layers()),
        TaskParameters(steps=5),
        Origin("epuck_kinematic", "arena", 0.01),
        {"validation": 1.0},
    )
    (tmp_path / CHAMPION).write_text(file.to_json())
    recording = tmp_path / "trial.rrd"
    pose = ("--pose", "0", "0", "0", "--robot", "epuck_kinematic")
    done = run(
        "evolution.replay", str(tmp_path / CHAMPION), *pose, "--save", str(recording)
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert recording.stat().st_size > 1000


def history(seed, best, control_steps):
    n = len(best)
    return pd.DataFrame(
        {
            "experiment": EXPERIMENT,
            "seed": seed,
            "generation": np.arange(n),
            "best": best,
            "control_steps": control_steps,
        }
    )


def test_growth_is_the_best_so_far_after_so_many_steps():
    frames = [history(1, [5.0, 3.0, 9.0], [10, 20, 10]), history(2, [1.0, 2.0], [5, 5])]
    found = growth(pd.concat(frames), np.array([10, 29, 30, 39, 40, 99]))
    np.testing.assert_array_equal(found, [[5, 5, 5, 5, 9, 9], [2, 2, 2, 2, 2, 2]])


@pytest.fixture
def study():
    frames = [history(seed, [5.0, 90.0 + seed], [10**6] * 2) for seed in (1, 2)]
    champions = pd.DataFrame(
        {
            "experiment": EXPERIMENT,
            "control_steps": [2 * 10**6] * 2,
            "epuck_kinematic_mean": [70.0, 75.0],
        }
    )
    others = champions.assign(experiment="ga", epuck_kinematic_mean=1.0)
    return Study(pd.concat([champions, others]), pd.concat(frames), {})


def test_both_are_compared_on_the_same_starts(study):
    tests = [{"robot": "epuck_kinematic", "mean": 77.0, "crash_rate": 0.02}]
    assert comparison({"looks": LOOKS, "seed": 4}, tests, study).splitlines() == [
        "PPO, seed 4: 3.0 million steps in 0.1 minutes, best at 3.0",
        "DE/best, 2 runs: 2.0 million steps, 2.0 to 2.0",
        "epuck_kinematic, test starts: PPO 77.0, crashes in 2.0%; DE/best 72.5 "
        "(median), 70.0 to 75.0",
    ]


def test_the_figure_has_all_of_both(study):
    figure = figure_of({"looks": LOOKS}, 77.0, study)
    [axes], [legend] = figure.axes, figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[0] == "DE/best, stored (n = 2)"
    assert len(texts) == 4
    stored, ppo = axes.lines
    assert np.asarray(stored.get_ydata())[-1] == 91.5
    np.testing.assert_array_equal(ppo.get_xdata(), [0, 3])
    # where PPO was best
    [[x, y]] = np.asarray(axes.collections[-1].get_offsets())
    assert (x, y) == (3, 77)


@pytest.mark.slow
def test_a_short_training_leaves_a_curve_and_a_champion(tmp_path):
    pytest.importorskip("stable_baselines3", reason="the extra 'ppo' is not installed")
    found = []
    for name in ("a", "b"):
        options = ("--steps", "70000", "--minutes", "4", "--output")
        done = run("benchmarks.ppo", *options, str(tmp_path / name))
        assert done.returncode == 0, done.stderr
        curve = json.loads((tmp_path / name / CURVE).read_text())
        assert [look["steps"] for look in curve["looks"]] == [0, 131_072]
        found.append((tmp_path / name / CHAMPION).read_text())
    # the same seed, the same champion
    assert found[0] == found[1]
    champion = json.loads(found[0])
    made_by = json.loads((tmp_path / "a" / "provenance.json").read_text())
    assert {"torch", "stable-baselines3", "numba"} <= set(made_by["versions"])
    assert set(champion["scene"]["own_sha256"]) == {NETWORK}
    best = max(look["fitness"] for look in curve["looks"])
    assert champion["scores"] == {"validation": best}
