"""Runs that climb from the kinematic robot to wheels, whose fitness counts alone."""

from copy import deepcopy

import numpy as np
import pytest

from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import ON_WHEELS
from evolution.judging.evaluation import BatchEngine, Work
from evolution.run.champion import best_stored, candidates, choose_champion, stored_by
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.generation_loop import Evolution
from evolution.run.means import Means
from evolution.search.ask_tell import AskTellError
from evolution.settings.config import ExperimentConfig
from evolution.verify.__main__ import verify

OPTIMIZERS = {
    "ga": {
        "algorithm": "genetic_algorithm",
        "population": 8,
        "bits": 8,
        "tournament": 2,
        "crossover": 0.8,
        "mutation": 0.02,
        "elites": 1,
    },
    "de": {
        "algorithm": "differential_evolution",
        "strategy": "best",
        "population": 8,
        "scale": 0.7,
        "crossover": 0.9,
    },
    "cma-es": {"algorithm": "cma_es", "population": 8},
    "lra-cma-es": {
        "algorithm": "cma_es",
        "population": 8,
        "restarts": False,
        "learning_rate_adaptation": True,
    },
    "es": {
        "algorithm": "evolution_strategy",
        "lineages": 8,
        "reevaluate_parents": False,
    },
    "random": {"algorithm": "random_search", "population": 8},
    # so large a budget that it does not shrink
    "l-shade": {"algorithm": "l_shade", "population": 8, "budget": 100_000},
    "es reevaluated": {"algorithm": "evolution_strategy", "lineages": 8},
    "l-shade shrinking": {"algorithm": "l_shade", "population": 12},
}
OF_EIGHT = [name for name in OPTIMIZERS if " " not in name]
"""Those whose generations are eight evaluations each."""
MORE = {
    "openai-es": {"algorithm": "openai_es", "pairs": 4},
    "ssshc": {"algorithm": "ssshc", "population": 6},
    "de, the best again": OPTIMIZERS["de"] | {"reevaluate_best": 2},
}
"""Optimisers whose generations are of other sizes than 8."""


def config(name: str = "de", **more) -> ExperimentConfig:
    fields = {
        "robot": "epuck_kinematic",
        "evaluations": 80,
        "steps": 15,
        "trials": 2,
        "climb": 0.5,
        "validation_starts": 6,
        "optimizer": (OPTIMIZERS | MORE)[name],
    }
    return ExperimentConfig.parsed(fields | more, "config")


def evolved(config: ExperimentConfig, **how) -> Evolution:
    evolution = Evolution(config, **{"threads": 1, **how})
    list(evolution.run())
    return evolution


class Watched:
    """Engine that notes on which robot how many trials were run."""

    def __init__(self, scene, task, seen: list[tuple[str, int]]):
        self._engine, self._name, self._seen = (
            BatchEngine(scene, task, 1),
            scene.name,
            seen,
        )

    def run(self, work: Work):
        self._seen.append((self._name, len(work)))
        return self._engine.run(work)


@pytest.mark.parametrize(("robot", "wheels"), ON_WHEELS.items())
def test_each_kinematic_robot_climbs_to_its_own_on_wheels(tmp_path, robot, wheels):
    """There its champion is chosen, tested and, with the run, verified."""
    c = config(robot=robot, test_starts=5)
    run = Run(c, RunDirectory(tmp_path / "run", drawn=False), Means(threads=1), [])
    run.start()
    list(run.evolve())
    scores = run.finish()
    robots = [line.split(",")[-1] for line in run.evolution.history().splitlines()[1:]]
    assert robots == [robot] * 5 + [wheels] * 4
    assert list(scores.held_out) == [wheels, robot]
    assert scores.best_stored is not None
    assert scores.best_stored.robot == wheels
    assert scores.in_lines(15).startswith("The champion earns")
    assert f"fresh starts on {wheels};" in scores.in_lines(15)
    champion = choose_champion(
        BatchEngine(run.evolution.scene, c.task, 1),
        run.evolution,
        stored_by(run.evolution),
        BatchEngine(load_scene(wheels, "arena"), c.task, 1),
    )
    assert champion.validation_fitness == scores.validation
    assert verify([str(tmp_path / "run"), "--threads", "1"]) == 0


@pytest.mark.parametrize("name", OF_EIGHT)
def test_the_population_is_evaluated_anew_and_paid_for(name):
    seen: list[tuple[str, int]] = []
    c = config(name)
    evolution = Evolution(c, lambda scene: Watched(scene, c.task, seen))
    before = np.full(8, np.nan)
    for record in evolution.run():
        if not record.climbed:
            before = evolution.optimizer.fitness.copy()
        elif not evolution.records[-2].climbed:
            # of what was stored before, nothing is left
            assert not np.isin(evolution.optimizer.fitness, before[before > 1e-3]).any()
    # five generations of 8; then each of 8, and 8 more once
    trials = [(robot, n // 2) for robot, n in seen]
    assert trials[:5] == [("epuck_kinematic", 8)] * 5
    assert trials[5:] == [("epuck", 8)] * 5
    spent = [record.evaluations for record in evolution.records]
    assert spent == [8, 16, 24, 32, 40, 56, 64, 72, 80]
    assert [record.climbed for record in evolution.records] == [False] * 5 + [True] * 4
    robots = [line.split(",")[-1] for line in evolution.history().splitlines()]
    assert robots == ["robot", *["epuck_kinematic"] * 5, *["epuck"] * 4]


@pytest.mark.parametrize(
    ("more", "robots"),
    [
        ({"climb": 1.0}, {"epuck_kinematic"}),
        ({"robot": "epuck"}, {"epuck"}),
        # nothing is left for a climb
        ({"climb": 0.95}, {"epuck_kinematic"}),
    ],
)
def test_not_every_run_climbs(more, robots):
    lines = evolved(config(**more)).history().splitlines()[1:]
    assert {line.split(",")[-1] for line in lines} == robots


@pytest.mark.parametrize("name", MORE)
def test_a_population_of_any_size_is_paid_for(name):
    evolution = Evolution(config(name), threads=1)
    spent, climbed = 0, False
    for record in evolution.run():
        # evaluated anew at the climb
        anew = record.climbed and not climbed
        climbed = record.climbed
        asked = record.evaluations - spent - anew * len(evolution.optimizer.population)
        assert (
            asked
            == {
                "openai-es": 9,
                "ssshc": 12 if record.generation % 2 else 6,
                "de, the best again": 10 if record.generation else 8,
            }[name]
        )
        spent = record.evaluations
    assert climbed
    assert 80 - evolution.optimizer.next_size() < spent <= 80


@pytest.mark.parametrize("name", ["ssshc", "de, the best again"])
def test_means_begin_again_where_fitness_is_judged_anew(name):
    optimizer = Evolution(config(name)).optimizer
    for _ in range(6):
        optimizer.tell(np.arange(len(optimizer.ask()))[::-1])
    assert optimizer.state()["evaluations"].max() > 1
    optimizer.judge_anew(np.zeros(len(optimizer.population)))
    assert optimizer.state()["evaluations"].tolist() == [1] * len(optimizer.population)


@pytest.mark.parametrize("name", [*OPTIMIZERS, *MORE])
def test_resumed_anywhere_it_ends_the_same(name):
    whole = Evolution(config(name), threads=1)
    states = [
        deepcopy(whole.state())
        for record in whole.run()
        if record.generation in (4, 5, 6)
    ]
    expected = whole.history()
    for state in states:
        resumed = Evolution(config(name), threads=1)
        resumed.restore(state)
        list(resumed.run())
        assert resumed.history() == expected
        np.testing.assert_array_equal(
            resumed.optimizer.population, whole.optimizer.population
        )


def test_a_population_that_shrinks_counts_what_is_judged_anew():
    evolution = evolved(config("l-shade shrinking"))
    assert evolution.climbed
    assert evolution.optimizer.arrays()["counts"][2] == evolution.evaluations
    # of 12, with 4 at the end of the run's evaluations
    left = 4 + 8 * (1 - evolution.evaluations / 80)
    assert len(evolution.optimizer.population) == round(left)


def test_parents_are_evaluated_anew_and_then_again_and_again():
    records = evolved(config("es reevaluated")).records
    spent = [record.evaluations for record in records]
    # 8, then parents with offspring; all parents anew once
    assert spent == [8, 24, 40, 64, 80]
    assert [record.climbed for record in records] == [False] * 3 + [True] * 2


def test_engine_threads_and_racing_change_nothing():
    c = config(evaluations=120, steps=30)
    expected = evolved(c).history()
    assert expected.count("epuck\n") > 2
    for how in ({"threads": 2}, {"racing": False}, {"engine": "dm_control"}):
        assert evolved(c, **how).history() == expected


def test_what_is_judged_anew_has_to_fit():
    optimizer = Evolution(config()).optimizer
    with pytest.raises(AskTellError, match=r"expected fitness of shape \(8,\)"):
        optimizer.judge_anew(np.zeros(7))
    optimizer.ask()
    with pytest.raises(AskTellError, match="cannot judge anew"):
        optimizer.judge_anew(np.zeros(8))
    optimizer.tell(np.zeros(8))
    optimizer.judge_anew([1, 2, 3, 4, 5, 6, 7, np.nan])
    assert optimizer.fitness[6] == 7
    assert optimizer.fitness[7] == -np.inf


def test_only_what_was_stored_on_wheels_counts_as_best_after_a_climb():
    evolution = evolved(config())
    cheap = evolution.records[:5]
    evolution.records[0] = type(cheap[0])(0, 8, 1e9, 0.0, 0.0, 1, 0.0)
    genome, stored = best_stored(stored_by(evolution))
    assert stored < 1e9
    assert any((genome == other).all() for other in evolution.best_genomes[5:])
    assert candidates(stored_by(evolution))[1].max() < 1e9


@pytest.mark.parametrize("finalists", [0, 1, 3])
def test_finalists_are_compared_on_wheels(monkeypatch, finalists):
    monkeypatch.setattr("evolution.run.champion.N_SCREENING", 10)
    c = config(finalists=finalists)
    evolution = evolved(c)
    seen: list[tuple[str, int]] = []
    cheap, wheels = (
        Watched(scene, c.task, seen)
        for scene in (evolution.scene, evolution._evolved[-1])
    )
    champion = choose_champion(cheap, evolution, stored_by(evolution), wheels)
    everybody = len(candidates(stored_by(evolution))[0])
    assert everybody >= 8
    expected = [("epuck_kinematic", everybody * 6), ("epuck_kinematic", 8 * 10)]
    if everybody > 8:
        expected[1] = ("epuck_kinematic", min(everybody, 10) * 10)
    if finalists:
        expected.append(("epuck", finalists * 6))
    assert seen == expected
    assert np.isfinite(champion.validation_fitness)


@pytest.mark.parametrize("name", OF_EIGHT)
@pytest.mark.parametrize("evaluations", [24, 80, 87])
def test_a_run_too_short_to_climb_spends_all_on_the_kinematic_robot(name, evaluations):
    """Population and generation do not fit into the last tenth."""
    evolution = evolved(config(name, climb=0.9, evaluations=evaluations))
    assert not evolution.climbed
    assert evolution.evaluations == evaluations - evaluations % 8
