"""The generation loop: deterministic, resumable, and within its budget."""

import io
from dataclasses import astuple, replace
from functools import cache

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.rungs.simulator import Simulator
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.model import Scene
from epuck_mj.step.control import TaskParameters, control_step
from epuck_mj.step.sensors import observe
from evolution.judging.held_out_starts import starts_for_test, starts_for_validation
from evolution.run.generation_loop import Evolution
from evolution.run.history import HISTORY, Record
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.settings.randomness import Purpose, random_generator

SHIPPED = ("de-best", "de-rand", "ga")
every_experiment = pytest.mark.parametrize("name", SHIPPED)


def tiny(name: str, population: int = 8, **update) -> ExperimentConfig:
    """A shipped experiment of a few generations and trials."""
    config = load_config(find_config(name))
    update = {"evaluations": 5 * population, "steps": 30, "trials": 2} | update
    optimizer = replace(config.optimizer, population=population)
    return config.model_copy(update={"optimizer": optimizer} | update)


def evolved(config: ExperimentConfig, generations: int | None = None, **how):
    """An experiment after so many generations; all of them if None."""
    experiment = Evolution(config, **{"threads": 1, **how})
    run = experiment.run()
    for _ in run if generations is None else range(generations):
        if generations is not None:
            next(run)
    return experiment


@cache
def whole(name: str) -> Evolution:
    """`tiny`, evolved: to be looked at only, since tests share it."""
    experiment = evolved(tiny(name))
    # its robots take a fifth of a gigabyte
    del experiment.engine
    return experiment


def assert_same(a: Evolution, b: Evolution) -> None:
    """Equal to the last bit, in all that is saved."""
    assert a.history() == b.history()
    left, right = a.state(), b.state()
    assert list(left) == list(right)
    for key in left:
        np.testing.assert_array_equal(left[key], right[key], err_msg=key)


def through_a_file(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **state)
    buffer.seek(0)
    with np.load(buffer, allow_pickle=False) as file:
        return dict(file)


class Watched:
    """An engine that remembers what went through it."""

    def __init__(self, engine):
        self.engine = engine
        self.calls = []

    def run(self, work):
        trials = self.engine.run(work)
        self.calls.append((work.controller, work.starts.copy(), trials))
        return trials


def watch(experiment: Evolution) -> Watched:
    watched = Watched(experiment.engine)
    experiment.engine = watched
    return watched


# determinism


@every_experiment
def test_equal_seeds_give_equal_runs(name):
    assert_same(evolved(tiny(name)), whole(name))


@every_experiment
def test_other_seeds_give_other_runs(name):
    one, two = (evolved(tiny(name, seed=seed), 2) for seed in (1, 2))
    assert one.history() != two.history()
    assert not np.array_equal(one.optimizer.population, two.optimizer.population)


@every_experiment
def test_the_number_of_threads_changes_nothing(name):
    assert_same(evolved(tiny(name), threads=2), whole(name))


@every_experiment
def test_both_engines_give_the_same_bytes(name):
    config = tiny(name, robot="epuck", steps=40, evaluations=16)
    batch, dm_control = (
        evolved(config, engine=engine, racing=False)
        for engine in ("batch", "dm_control")
    )
    # or the comparison would say nothing about crashes
    assert any(record.crash_rate > 0 for record in batch.records)
    assert batch.history().encode() == dm_control.history().encode()
    assert_same(batch, dm_control)


def test_unknown_engine_is_refused_with_the_available_ones():
    with pytest.raises(UserError, match=r"'stage'; available: batch, dm_control$"):
        Evolution(tiny("ga"), engine="stage")


def test_streams_depend_on_each_part_of_their_key():
    keys = [(1,), (2,), (1, 0), (1, 1), (1, 0, 0), (2, 0)]
    draws = [random_generator(*key).random(4).tolist() for key in keys]
    assert draws[0] == random_generator(1).random(4).tolist()
    assert all(a != b for i, a in enumerate(draws) for b in draws[:i])
    assert len(set(Purpose)) == len(Purpose.__members__) == 6


# records


@cache
def one_robot(scene: Scene) -> Simulator:
    """A robot in a scene, made once."""
    return robots_in(scene, 1, 1)


def slow_trial(scene, policy, start, task: TaskParameters) -> tuple[float, int, bool]:
    """Fitness of one robot's trial, the steps it lived and whether it crashed."""
    robots = one_robot(scene)
    observation = observe(robots.reset(start[None]).distance, task.sensor_range)
    fitness = 0.0
    for i in range(task.steps):
        step = control_step(robots, policy, observation, task, i)
        if step.reading.contact[0]:
            return fitness, i + 1, True
        fitness += float(step.fitness[0])
        observation = step.observation
    return fitness, task.steps, False


def test_a_generations_record_against_a_slow_loop():
    experiment = Evolution(tiny("ga", steps=40, trials=3), threads=1)
    generation = experiment.run()
    next(generation)
    record = next(generation)
    config, fitness, steps, crashes = experiment.config, [], [], []
    rng = random_generator(config.seed, Purpose.STARTS, 1)
    starts = experiment.space.sample(rng, 3)
    for genome in experiment.optimizer.population:
        controller = config.topology.decode(genome)
        trials = [
            slow_trial(experiment.scene, controller, start, config.task)
            for start in starts
        ]
        fitness.append(np.mean([trial[0] for trial in trials]))
        steps += [lived for _, lived, _ in trials]
        crashes += [crashed for _, _, crashed in trials]
    # the GA's population are the individuals last told
    assert experiment.optimizer.fitness.tolist() == fitness
    assert record == Record(
        generation=1,
        evaluations=16,
        best=max(fitness),
        mean=float(np.mean(fitness)),
        std=float(np.std(fitness)),
        control_steps=sum(steps),
        crash_rate=sum(crashes) / 24,
    )
    assert 0 < record.crash_rate < 1
    assert record.std > 0


@every_experiment
def test_records_describe_the_optimizers_stored_fitness(name):
    experiment = Evolution(tiny(name), threads=1)
    watched = watch(experiment)
    for i, record in enumerate(experiment.run()):
        fitness = experiment.optimizer.fitness
        assert (record.generation, record.evaluations) == (i, 8 * (i + 1))
        assert (record.best, record.mean) == (fitness.max(), fitness.mean())
        assert record.std == fitness.std()
        # crashes of what was asked now, not of what is stored
        _, _, trials = watched.calls[-1]
        assert record.crash_rate == trials.crashed.mean()
        assert record.control_steps == trials.steps.sum()
        best = experiment.optimizer.population[fitness.argmax()]
        np.testing.assert_array_equal(experiment.best_genomes[i], best)
    assert len(experiment.records) == len(experiment.best_genomes) == 5
    # or the crash rates above could all be of something else
    assert len({record.crash_rate for record in experiment.records}) > 1


@every_experiment
def test_a_trial_that_ends_in_no_number_counts_as_nothing(name):
    experiment = Evolution(tiny(name), threads=1)
    sound = experiment.engine.run

    def broken(work):
        found = sound(work)
        found.fitness[0] = np.nan
        return found

    experiment.engine.run = broken
    record = next(experiment.run())
    fitness = experiment.optimizer.fitness
    assert np.isneginf(fitness).sum() == 1
    assert record.mean == np.maximum(fitness, 0).mean()
    assert record.std == np.maximum(fitness, 0).std()
    # and the run can be read, and goes on
    resumed = Evolution(tiny(name), threads=1)
    resumed.restore(through_a_file(experiment.state()))
    assert_same(resumed, experiment)


@pytest.mark.parametrize("name", ["de-best", "de-rand"])
def test_differential_evolution_never_loses_its_best(name):
    best = [record.best for record in evolved(tiny(name, evaluations=80)).records]
    assert best == sorted(best)
    assert best[0] < best[-1]


def test_history_reads_back_exactly():
    experiment = whole("de-best")
    header, *rows = experiment.history().splitlines()
    assert header == "generation,evaluations,best,mean,std,robot"
    assert experiment.history().endswith("\n")
    for row, record in zip(rows, experiment.records, strict=True):
        generation, evaluations, *rest, robot = row.split(",")
        assert (int(generation), int(evaluations)) == astuple(record)[:2]
        assert tuple(map(float, rest)) == astuple(record)[2:5]
        assert robot == "epuck_kinematic"


def test_no_history_yet():
    experiment = Evolution(tiny("ga"))
    assert experiment.history() == ",".join(HISTORY) + ",robot\n"
    assert (experiment.evaluations, experiment.finished) == (0, False)


# budget


@every_experiment
@pytest.mark.parametrize(("evaluations", "generations"), [(23, 2), (24, 3)])
def test_the_budget_is_whole_generations_and_never_passed(
    name, evaluations, generations
):
    experiment = evolved(tiny(name, evaluations=evaluations, steps=5))
    assert len(experiment.records) == generations
    assert experiment.evaluations == 8 * generations <= evaluations
    assert experiment.finished
    assert list(experiment.run()) == []


@pytest.mark.parametrize(("evaluations", "spent"), [(23, [8]), (40, [8, 24, 40])])
def test_reevaluated_parents_are_counted(evaluations, spent):
    config = tiny("de-best", evaluations=evaluations, steps=5)
    optimizer = replace(config.optimizer, reevaluate_parents=True)
    experiment = evolved(config.model_copy(update={"optimizer": optimizer}))
    assert [record.evaluations for record in experiment.records] == spent


@every_experiment
def test_a_budget_below_one_generation_is_refused(name):
    with pytest.raises(UserError, match=r"at least one generation, 8 .*, got 7$"):
        Evolution(tiny(name, evaluations=7))


def test_an_initial_range_that_the_optimizer_cannot_have_is_refused():
    with pytest.raises(UserError, match="initial range"):
        Evolution(tiny("ga", weight_init=1.0))
    with pytest.raises(UserError, match="initial range"):
        Evolution(tiny("de-best", weight_init=6.0))


# state


@every_experiment
def test_resumed_is_uninterrupted(name):
    config = tiny(name)
    resumed = Evolution(config, threads=1)
    resumed.restore(through_a_file(evolved(config, 2).state()))
    assert resumed.evaluations == 16
    assert [record.generation for record in resumed.run()] == [2, 3, 4]
    assert_same(resumed, whole(name))


@every_experiment
def test_a_state_is_a_copy(name):
    config = tiny(name)
    experiment = Evolution(config, threads=1)
    run = experiment.run()
    next(run)
    state = experiment.state()
    before = through_a_file(state)
    list(run)
    for key, array in before.items():
        np.testing.assert_array_equal(array, state[key], err_msg=key)


def test_a_state_of_another_optimizer_is_refused():
    state = evolved(tiny("de-best"), 1).state()
    with pytest.raises(ValueError, match="'ga', got 'de-best'"):
        Evolution(tiny("ga")).restore(state)
    with pytest.raises(ValueError, match="population"):
        Evolution(tiny("de-best", population=9)).restore(state)


@pytest.mark.parametrize("missing", ["records", "best_genomes", "optimizer.fitness"])
def test_an_incomplete_state_is_refused(missing):
    state = evolved(tiny("ga"), 1).state()
    del state[missing]
    with pytest.raises(ValueError, match=missing.removeprefix("optimizer.")):
        Evolution(tiny("ga")).restore(state)


@pytest.fixture(scope="module")
def after_two():
    """The state after two generations, and an experiment that it belongs to."""
    return evolved(tiny("ga"), 2).state(), Evolution(tiny("ga"))


@pytest.mark.parametrize(
    ("key", "array"),
    [
        ("records", np.zeros(3)),
        ("records", np.zeros((2, 3))),
        ("records", np.zeros((0,))),
        ("records", np.full((2, 7), np.inf)),
        ("best_genomes", np.zeros(())),
        ("best_genomes", np.zeros((2, 3))),
        ("best_genomes", np.zeros((1, 40))),
        ("optimizer.generation", np.array(-5)),
        ("optimizer.generation", np.array(3)),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(after_two, key, array):
    state, experiment = after_two
    assert state[key].shape != array.shape or not np.array_equal(state[key], array)
    with pytest.raises(ValueError):
        experiment.restore({**state, key: array})


# starts


def starts_of(experiment: Evolution, generations: int) -> list[np.ndarray]:
    """Distinct starts of each generation, after a look at how they are dealt out."""
    watched = watch(experiment)
    run = experiment.run()
    for _ in range(generations):
        next(run)
    n, starts = experiment.config.trials, []
    for _, dealt, _ in watched.calls:
        individuals = dealt.reshape(-1, n, 3)
        # the same trials for everybody
        assert (individuals == individuals[0]).all()
        starts.append(individuals[0])
    return starts


def test_every_algorithm_of_a_seed_meets_the_same_starts():
    populations = {"de-best": 8, "de-rand": 9, "ga": 10}
    by_name = [
        starts_of(Evolution(tiny(name, population=size, trials=3, steps=5)), 3)
        for name, size in populations.items()
    ]
    for starts in by_name:
        assert np.array_equal(starts, by_name[0])


def test_starts_differ_between_generations_seeds_and_purposes():
    seen = []
    for seed in (0, 1, 2):
        experiment = Evolution(tiny("ga", steps=2, seed=seed, trials=5))
        seen += starts_of(experiment, 3)
    space = Evolution(tiny("ga")).space
    seen += [starts_for_validation(space), starts_for_test(space)]
    poses = np.concatenate(seen)
    assert len(np.unique(poses[:, 0])) == len(poses) == 3 * 3 * 5 + 200 + 1000


@pytest.mark.parametrize("every", [2, 3])
def test_starts_may_last_for_some_generations(every):
    starts = starts_of(
        Evolution(tiny("ga", steps=2, starts_every=every, evaluations=48)), 6
    )
    new = starts_of(Evolution(tiny("ga", steps=2)), 2)
    for generation, dealt in enumerate(starts):
        assert np.array_equal(dealt, starts[generation - generation % every])
    assert np.array_equal(starts[every], new[1])


@pytest.mark.parametrize("robot", ["epuck_kinematic", "epuck"])
def test_individuals_may_have_starts_of_their_own(robot):
    config = tiny("de-rand", steps=30, trials=3, own_starts=True, robot=robot)
    experiment = Evolution(config, threads=1)
    watched, run = watch(experiment), experiment.run()
    for _ in range(2):
        next(run)
    seen = np.concatenate([starts for _, starts, _ in watched.calls])
    assert len(np.unique(seen, axis=0)) == len(seen) == 2 * 8 * 3
    # and are evaluated on these: each alone
    controller, starts, trials = watched.calls[0]
    for i in range(8 * 3):
        alone, _, _ = slow_trial(
            experiment.scene, controller[i : i + 1], starts[i], config.task
        )
        assert trials.fitness[i] == alone


@pytest.mark.parametrize(
    ("draw", "n"), [(starts_for_validation, 200), (starts_for_test, 1000)]
)
def test_held_out_starts_are_the_same_for_every_run(draw, n):
    runs = [
        tiny("ga", seed=0),
        tiny("de-rand", seed=7, population=9, trials=3, steps=9, hidden=2),
    ]
    experiments = [Evolution(config) for config in runs]
    # used or not
    list(experiments[0].run())
    fixed = [draw(experiment.space) for experiment in experiments]
    assert fixed[0].shape == (n, 3)
    assert np.array_equal(fixed[0], fixed[1])
    assert np.array_equal(fixed[0], draw(experiments[0].space))


def test_held_out_starts_suit_the_wheeled_robot_too():
    cheap, wheeled = (
        Evolution(tiny("ga", robot=robot)).space
        for robot in ("epuck_kinematic", "epuck")
    )
    assert np.array_equal(starts_for_test(cheap), starts_for_test(wheeled))
