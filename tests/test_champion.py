"""The champion: who may be it, who is it, and what fresh starts say of it."""

import math
import statistics
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from epuck_mj.host import files
from epuck_mj.policies.file import Origin, load_controller
from epuck_mj.rungs.simulator import Simulator
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene
from epuck_mj.scene.model_files import MODELS
from epuck_mj.show import figures, pictures, recording
from epuck_mj.step.control import control_step
from epuck_mj.step.sensors import observe
from epuck_mj.trials.recorder import record
from epuck_mj.trials.trajectory import Trajectory
from evolution.judging.evaluation import BatchEngine
from evolution.judging.held_out import Judge, Judges
from evolution.judging.held_out_starts import (
    held_out_disturbances,
    starts_for_test,
    starts_for_validation,
)
from evolution.judging.scores import BestStored, Scores
from evolution.run import champion as champion_choice
from evolution.run import results
from evolution.run.champion import (
    LATEST_BEST,
    Champion,
    best_stored,
    candidates,
    choose_champion,
    stored_by,
)
from evolution.run.directory import RunDirectory
from evolution.run.generation_loop import Evolution
from evolution.run.history import Record
from evolution.run.results import write_results
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.settings.randomness import Purpose
from tests.no_pictures import draw_nothing

SHIPPED = ("de-best", "de-rand", "ga")
ROUND_WALL, LEANING_WALL = (
    f'<geom type="cylinder" size=".02 .1" pos=".2 .2 .05" euler="{lean} 0 0"/>'
    "</worldbody>"
    for lean in (0, 20)
)


def tiny(name: str, population: int = 20, **update) -> ExperimentConfig:
    config = load_config(find_config(name))
    optimizer = replace(config.optimizer, population=population)
    sizes = {"evaluations": 6 * population, "steps": 25, "trials": 2}
    update = sizes | {"validation_starts": 12, "test_starts": 30} | update
    return config.model_copy(update={"optimizer": optimizer} | update)


def judges_of(config: ExperimentConfig) -> dict[str, Judge]:
    return Judges(threads=1).tested_on(config.robot, config.setting)


@pytest.fixture(scope="module", params=SHIPPED)
def finished(request):
    """A finished run of each algorithm, and what it was after each generation."""
    experiment = Evolution(tiny(request.param), threads=1)
    generations = [
        (experiment.optimizer.population.copy(), experiment.optimizer.fitness.copy())
        for _ in experiment.run()
    ]
    return experiment, generations


@cache
def one_robot(scene: Scene) -> Simulator:
    """A robot in a scene, made once."""
    return robots_in(scene, 1, 1)


def slow_trial(experiment: Evolution, genome, start) -> tuple[float, bool]:
    """Fitness of a genome's trial on one start, alone, and whether it crashed."""
    task = experiment.config.task
    policy = experiment.config.topology.decode(genome)
    robots = one_robot(experiment.scene)
    observation = observe(robots.reset(start[None]).distance, task.sensor_range)
    fitness = 0.0
    for k in range(task.steps):
        step = control_step(robots, policy, observation, task, k)
        if step.reading.contact[0]:
            return fitness, True
        fitness += float(step.fitness[0])
        observation = step.observation
    return fitness, False


# candidates


def slow_candidates(generations) -> dict[tuple, set[float]]:
    """Genomes that may be champion, each with the fitness it was ever stored with."""
    population, fitness = generations[-1]
    allowed: dict[tuple, set[float]] = {}
    for i in range(len(fitness)):
        allowed.setdefault(tuple(population[i]), set()).add(fitness[i])
    best_so_far = -math.inf
    for population, fitness in generations:
        i = max(range(len(fitness)), key=lambda i: (fitness[i], -i))
        if fitness[i] > best_so_far:
            best_so_far = fitness[i]
            allowed.setdefault(tuple(population[i]), set()).add(fitness[i])
    return allowed


def test_candidates_are_the_last_population_and_the_best_so_far(finished):
    experiment, generations = finished
    genomes, stored = candidates(stored_by(experiment))
    expected = slow_candidates(generations)
    found = [tuple(genome) for genome in genomes]
    assert len(found) == len(set(found))
    assert set(found) == set(expected)
    for genome, fitness in zip(found, stored, strict=True):
        assert fitness in expected[genome]
    # or one of the two kinds would not be tested
    assert len(found) > 2


def test_the_latest_twenty_of_the_best_so_far_are_candidates():
    experiment = Evolution(tiny("ga"))
    rng, genes = np.random.default_rng(1), experiment.config.topology.n_genes
    told = rng.random(20)
    experiment.optimizer.ask()
    experiment.optimizer.tell(told)
    n = LATEST_BEST + 5
    # each generation raises the best; after it two that do not
    for i in range(n):
        for best in (10.0 + i, 10.0 + i, 5.0):
            record = Record(len(experiment.records), 0, best, 0.0, 0.0, 0, 0.0)
            experiment.records.append(record)
            experiment.best_genomes.append(rng.random(genes))
    genomes, stored = candidates(stored_by(experiment))
    top = sorted(told, reverse=True)
    assert stored.tolist() == top + [10.0 + i for i in range(5, n)]
    latest = np.array(experiment.best_genomes)[15::3]
    np.testing.assert_array_equal(genomes[20:], latest)


def test_a_genome_that_is_both_is_one_candidate():
    experiment = Evolution(tiny("ga"))
    next(experiment.run())
    population, fitness = experiment.optimizer.population, experiment.optimizer.fitness
    order = np.argsort(-fitness, kind="stable")
    genomes, stored = candidates(stored_by(experiment))
    np.testing.assert_array_equal(genomes, population[order])
    np.testing.assert_array_equal(stored, fitness[order])


# the choice


def test_the_champion_is_best_on_the_validation_starts(finished, monkeypatch):
    monkeypatch.setattr(champion_choice, "N_SCREENING", 12)
    experiment, _ = finished
    starts = starts_for_validation(experiment.space, 12)
    genomes, stored = candidates(stored_by(experiment))
    means = [
        np.mean([slow_trial(experiment, genome, start)[0] for start in starts])
        for genome in genomes
    ]
    best = max(range(len(means)), key=lambda i: (means[i], -i))
    champion = choose_champion(experiment.engine, experiment, stored_by(experiment))
    np.testing.assert_array_equal(champion.genome, genomes[best])
    assert champion.stored_fitness == stored[best]
    assert champion.validation_fitness == means[best]
    assert len(set(means)) > 1


def test_in_mujoco_the_best_of_a_first_round_meet_again(monkeypatch):
    """All of the last population have a tenth of the starts, the best have all."""
    monkeypatch.setattr(champion_choice, "SCREENED", 3)
    experiment = Evolution(tiny("ga", robot="epuck", validation_starts=20))
    for _ in experiment.run():
        pass
    genomes, stored = candidates(stored_by(experiment))
    starts = starts_for_validation(experiment.space, 20)

    def mean(genome: np.ndarray, n: int) -> float:
        trials = [slow_trial(experiment, genome, start) for start in starts[:n]]
        return float(np.mean([fitness for fitness, _ in trials]))

    first = [mean(genome, 2) for genome in genomes]
    kept = sorted(range(len(genomes)), key=lambda i: (-first[i], i))[:3]
    second = {i: mean(genomes[i], 20) for i in kept}
    best = max(kept, key=lambda i: (second[i], -kept.index(i)))
    champion = choose_champion(experiment.engine, experiment, stored_by(experiment))
    np.testing.assert_array_equal(champion.genome, genomes[best])
    assert champion.stored_fitness == stored[best]
    assert champion.validation_fitness == pytest.approx(second[best], abs=1e-12)


def test_stored_fitness_does_not_choose_the_champion():
    """A lucky draw is a candidate, and loses to who is better on fresh starts."""
    experiment = Evolution(tiny("ga", robot="epuck", steps=10))
    genes = experiment.config.topology.n_genes
    # fast and straight ahead; standing still
    fast, still = np.zeros(genes), np.zeros(genes)
    fast[32:36], still[32:36] = 5.0, -5.0
    experiment.optimizer.ask()
    experiment.optimizer.tell(np.full(20, -1.0))
    experiment.optimizer.population = np.tile(still, (20, 1))
    for best, genome in ((3.0, fast), (9.0, still)):
        record = Record(len(experiment.records), 20, best, 0.0, 0.0, 0, 0.0)
        experiment.records.append(record)
        experiment.best_genomes.append(genome)
    champion = choose_champion(experiment.engine, experiment, stored_by(experiment))
    np.testing.assert_array_equal(champion.genome, fast)
    assert champion.stored_fitness == 3.0


# the report


def test_held_out_against_a_slow_loop(finished):
    experiment, _ = finished
    config = experiment.config
    judge = Judge(experiment.scene, experiment.space, config.task, threads=1)
    # the first of all test starts
    starts = starts_for_test(experiment.space)[:25]
    np.testing.assert_array_equal(judge.starts(25), starts)
    # drives straight on, so that some of the trials crash
    genome = np.zeros(config.topology.n_genes)
    genome[32:36] = 5.0
    trials = [slow_trial(experiment, genome, start) for start in starts]
    fitness = [trial[0] for trial in trials]
    report = judge.test(config.topology.decode(genome), 25)
    assert report.mean == np.mean(fitness)
    assert report.mean == pytest.approx(statistics.mean(fitness), rel=1e-12)
    assert report.standard_deviation == pytest.approx(
        statistics.stdev(fitness), rel=1e-12
    )
    assert report.interval[0] < report.mean < report.interval[1]
    assert report.crash_rate == sum(crashed for _, crashed in trials) / 25
    assert report.starts == 25
    assert 0 < report.crash_rate < 1
    assert report.standard_deviation > 0


def champion_of(experiment: Evolution) -> Champion:
    """The champion, chosen as a run does."""
    wheels = BatchEngine(
        judges_of(experiment.config)["epuck"].scene, experiment.config.task, 1
    )
    return choose_champion(experiment.engine, experiment, stored_by(experiment), wheels)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Results of a run, without the pictures."""
    directory = RunDirectory(tmp_path_factory.mktemp("run"))
    experiment = Evolution(tiny("de-best", steps=20), threads=1)
    list(experiment.run())
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        write_results(experiment, judges_of(experiment.config), directory, threads=1)
    return experiment, directory


def test_the_champion_file_loads_and_acts_bit_for_bit(written):
    experiment, directory = written
    champion = champion_of(experiment)
    stored = load_controller(directory.champion)
    assert stored.genome.tobytes() == champion.genome.tobytes()
    assert stored.network == experiment.config.topology
    observation = np.random.default_rng(3).random((100, 8))
    own = experiment.config.topology.decode(champion.genome)
    assert stored.controller(observation).tobytes() == own(observation).tobytes()
    # alone as in a crowd
    alone = [stored.controller(row) for row in observation]
    assert np.array(alone).tobytes() == own(observation).tobytes()


def test_the_champion_file_holds_every_score(written):
    experiment, directory = written
    champion = champion_of(experiment)
    stored = load_controller(directory.champion)
    policy = experiment.config.topology.decode(champion.genome)
    tests = {
        robot: judge.test(policy, 30)
        for robot, judge in judges_of(experiment.config).items()
    }
    assert list(tests) == ["epuck", "epuck_kinematic"]
    # the individual with the highest stored fitness, on the robot it climbed to
    genome, best = best_stored(stored_by(experiment))
    robot = "epuck" if experiment.climbed else "epuck_kinematic"
    judge = judges_of(experiment.config)[robot]
    worth = judge.test(experiment.config.topology.decode(genome), 30)
    assert Scores.read(stored.scores, directory.champion) == Scores(
        stored=champion.stored_fitness,
        validation=champion.validation_fitness,
        held_out=tests,
        best_stored=BestStored(fitness=best, held_out=worth.mean, robot=robot),
    )
    assert list(stored.scores) == ["stored", "validation", "held_out", "best_stored"]
    assert stored.task == experiment.config.task
    assert stored.origin == Origin(
        "epuck_kinematic", "arena", 0.01, dict(experiment.scene.sha256)
    )


def test_a_champion_of_disturbed_robots_is_tested_on_such_as_well(
    tmp_path, monkeypatch
):
    # the trajectory is enough of what is shown
    monkeypatch.setattr(results, "_draw_fitness", lambda *_: None)
    for module, name in (
        (figures, "trajectory_figure"),
        (pictures, "save_figure"),
        (recording, "save_recording"),
    ):
        monkeypatch.setattr(module, name, lambda *_: None)
    config = tiny("ga", steps=60, noise="strong", randomise=True)
    experiment = Evolution(config, threads=1)
    list(experiment.run())
    directory = RunDirectory(tmp_path)
    scores = write_results(experiment, judges_of(config), directory, threads=1)
    stored = load_controller(directory.champion)
    assert Scores.read(stored.scores, directory.champion) == scores
    found = scores.held_out_as_evolved
    assert list(found) == list(scores.held_out) == ["epuck", "epuck_kinematic"]
    # the first of those that anybody draws
    met = held_out_disturbances(config.conditions, Purpose.TEST, 1000, config.steps)
    assert met is not None
    test = judges_of(config)["epuck"].test(stored.controller, 30, met)
    assert found["epuck"] == test
    assert test.mean != scores.held_out["epuck"].mean
    _, _, disturbed, *_ = scores.in_lines(60.0).splitlines()
    assert disturbed.startswith("With the disturbances it evolved with: ")
    # and shown so: the recorded trial is the first of that test
    judge, shown = judges_of(config)["epuck"], Trajectory.load(directory.trajectory)
    start, policy = judge.starts(1)[0], stored.controller
    first = record(judge.scene, policy, start, config.task, met[:1])
    ideal = record(judge.scene, policy, start, config.task)
    np.testing.assert_array_equal(shown.pose, first.pose)
    np.testing.assert_array_equal(shown.proximity, first.proximity)
    assert shown.pose.tobytes() != ideal.pose.tobytes()


def test_the_summary_names_each_robot_and_both_kinds_of_fitness(written):
    _, directory = written
    stored = load_controller(directory.champion).scores
    scores = Scores.read(stored, directory.champion)
    headline, cheap, own, *highest = scores.in_lines(20.0).splitlines()
    tests = stored["held_out"]
    mean, crashes = tests["epuck"]["mean"], tests["epuck"]["crash_rate"]
    assert headline == (
        f"The champion earns {mean:.1f} of 20: the mean of 30 fresh starts on epuck; "
        f"{crashes:.0%} of the trials end in a crash"
    )
    mean, crashes = (tests["epuck_kinematic"][key] for key in ("mean", "crash_rate"))
    assert cheap == f"On epuck_kinematic {mean:.1f} ({crashes:.0%} crash)"
    assert own.startswith(f"Evolution stored {stored['stored']:.1f} for it, from the")
    best = stored["best_stored"]
    assert len(highest) == (best["fitness"] != stored["stored"])
    other = scores.model_copy(
        update={"best_stored": BestStored(fitness=9.0, held_out=3.0)}
    )
    assert other.in_lines(20.0).splitlines()[-1] == (
        "The highest fitness that evolution stored was 9.0, of an individual that "
        "earns 3.0 on fresh starts"
    )
    # of an unknown maximum nothing is said
    assert " of 20" not in scores.in_lines(None)


@pytest.mark.parametrize(
    ("robot", "arena", "tested"),
    [
        ("epuck", ROUND_WALL, ["epuck", "epuck_kinematic"]),
        # a leaning cylinder has no exact outline
        ("epuck", LEANING_WALL, ["epuck"]),
        ("epuck_kinematic", ROUND_WALL, ["epuck", "epuck_kinematic"]),
        ("own.xml", ROUND_WALL, ["own.xml", "epuck"]),
    ],
)
def test_a_run_is_tested_on_wheels_and_on_one_robot_more_that_can_be(
    robot, arena, tested, tmp_path, monkeypatch
):
    draw_nothing(monkeypatch)
    path = tmp_path / "mine.xml"
    path.write_text((MODELS / "arena.xml").read_text().replace("</worldbody>", arena))
    monkeypatch.chdir(tmp_path)
    Path("own.xml").write_text((MODELS / "epuck.xml").read_text())
    settings = {"robot": robot, "arena": str(path), "steps": 10, "evaluations": 20}
    experiment = Evolution(tiny("ga", **settings))
    list(experiment.run())
    directory = RunDirectory(tmp_path)
    scores = write_results(experiment, judges_of(experiment.config), directory)
    assert list(scores.held_out) == tested
    written = load_controller(directory.champion)
    assert directory.champion.read_text(encoding="utf-8") == written.to_json()
    assert len(scores.in_lines(10.0).splitlines()) in (1 + len(tested), 2 + len(tested))


def test_a_champion_survives_the_checkpoint(finished, tmp_path):
    experiment, _ = finished
    path = tmp_path / "checkpoint.npz"
    files.write_arrays(path, experiment.state())
    resumed = Evolution(experiment.config, threads=1)
    resumed.restore(files.read_arrays(path))
    left, right = candidates(stored_by(experiment)), candidates(stored_by(resumed))
    for a, b in zip(left, right, strict=True):
        np.testing.assert_array_equal(a, b)
    a, b = (
        choose_champion(run.engine, run, stored_by(run))
        for run in (experiment, resumed)
    )
    assert a.genome.tobytes() == b.genome.tobytes()
    assert (a.stored_fitness, a.validation_fitness) == (
        b.stored_fitness,
        b.validation_fitness,
    )
