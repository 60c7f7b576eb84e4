"""Racing: who can only lose is broken off, and no comparison comes out differently."""

from dataclasses import fields, replace
from functools import cache
from itertools import islice, repeat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from epuck_mj.policies.network import Network
from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters, Trials, run_trials
from epuck_mj.step.fitness import FORMULAS, step_fitness
from epuck_mj.trials.recorder import record
from evolution.judging import evaluation
from evolution.judging.evaluation import ROUNDING, BatchEngine, Race, evaluate
from evolution.run.champion import choose_champion, stored_by
from evolution.run.generation_loop import Evolution
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from tests.shipped import HYBRIDS, OPTIMIZERS

SCENE = load_scene("epuck", "arena")
SPACE = FreeSpace(SCENE, 0.01)
NETWORK = Network()
TASK = TaskParameters(steps=60)

ELITIST = "one-plus-one-es-as-first-shipped"
RACES = (
    *("de-best", "de-rand", "random-search", "l-shade", "ssshc", ELITIST),
    *("de-best-then-cma-es", "memetic-de", "lifetime-learning"),
)
"""Optimisers that forget who does not beat somebody."""


def controllers(n: int):
    genomes = np.random.default_rng(1).uniform(-5, 5, (n, NETWORK.n_genes))
    # some that are sure to hit a wall: full speed ahead
    genomes[::2, 32:36], genomes[::2, 36:] = 5, 0
    return NETWORK.decode(genomes)


def starts(n: int, seed: int = 0) -> np.ndarray:
    return SPACE.sample(np.random.default_rng(seed), n)


def assert_equal(a: Trials, b: Trials, who: slice | np.ndarray = slice(None)) -> None:
    for field in fields(Trials):
        left, right = getattr(a, field.name)[who], getattr(b, field.name)[who]
        np.testing.assert_array_equal(left, right, err_msg=field.name)


# what a step is worth


def unit(*shape: int):
    return arrays(np.float64, shape, elements=st.floats(0, 1))


@pytest.mark.parametrize("name", FORMULAS)
@given(drive=unit(20), turn=unit(20), left=st.booleans(), observation=unit(20, 8))
def test_no_step_is_worth_more_than_the_most(name, drive, turn, left, observation):
    action = np.stack([drive, -turn if left else turn], axis=-1)
    fitness = FORMULAS[name](action, observation)
    assert (fitness <= step_fitness(name).maximum).all()
    # so that what was earned never shrinks again
    assert (fitness >= 0).all()


@pytest.mark.parametrize("name", FORMULAS)
def test_the_most_is_not_too_much(name):
    # where it pays most: at a distance, or at contact
    nearest = 0.3 if name == "spaced" else 0.0
    action, observation = np.array([1.0, 0.0]), np.full(8, nearest)
    assert FORMULAS[name](action, observation) == step_fitness(name).maximum


# trials that are broken off

N = 16


class Schedule:
    """Breaks trials off after so many steps, and remembers what it was told."""

    def __init__(self, after: dict[int, int]):
        self.after = after
        self.most: list[np.ndarray] = []

    def __call__(self, most: np.ndarray) -> np.ndarray:
        self.most.append(most.copy())
        lost = np.zeros(N, bool)
        lost[[i for i, steps in self.after.items() if len(self.most) >= steps]] = True
        return lost


def outcome(after: dict[int, int]) -> tuple[Trials, list[np.ndarray]]:
    lost = Schedule(after)
    robots = MujocoRobots(SCENE, N, 1)
    return run_trials(robots, controllers(N), starts(N), TASK, lost), lost.most


@pytest.fixture(scope="module")
def lived():
    """Trials that all live, and each of them alone, step by step."""
    robots = MujocoRobots(SCENE, N, 1)
    trials = run_trials(robots, controllers(N), starts(N), TASK)
    alone = [
        record(SCENE, controllers(N)[i : i + 1], starts(N)[i], TASK) for i in range(N)
    ]
    # or nothing below were about trials of either kind
    assert 2 < trials.crashed.sum() < N - 2
    return trials, alone


def test_asking_changes_nothing(lived):
    trials, _ = outcome({})
    assert_equal(trials, lived[0])


def test_a_trial_can_still_reach_what_it_has_and_1_for_every_step_left(lived):
    _, most = outcome({})
    assert len(most) == TASK.steps
    for n, told in enumerate(most, start=1):
        for i, trial in enumerate(lived[1]):
            # one after the other, as they are added up
            earned = sum(trial.fitness[:n].tolist())
            over = trial.crashed and trial.steps <= n
            assert told[i] == earned + (0 if over else TASK.steps - n)


def test_a_trial_broken_off_keeps_what_it_earned_and_has_not_crashed(lived):
    whole, alone = lived
    after = {i: 3 + i for i in range(0, N, 2)}
    trials, _ = outcome(after)
    early = [i for i, steps in after.items() if steps < whole.steps[i]]
    assert early
    for i in early:
        assert trials.steps[i] == after[i]
        assert not trials.crashed[i]
        assert trials.fitness[i] == sum(alone[i].fitness[: after[i]].tolist())
    others = np.setdiff1d(np.arange(N), early)
    assert_equal(trials, whole, others)


def test_a_trial_that_crashes_when_it_is_lost_has_crashed(lived):
    whole, _ = lived
    after = dict(enumerate(whole.steps.tolist()))
    assert_equal(outcome(after)[0], whole)


def test_nobody_is_stepped_once_all_are_lost():
    trials, most = outcome(dict.fromkeys(range(N), 2))
    assert len(most) == 2
    assert trials.steps.max() == 2


# the race


def test_a_race_by_hand():
    race = Race(np.array([1.0, 2.0, -np.inf]), trials=2)
    # means: just 1; 1.5, which is not 2; anything
    most = np.array([0.5, 1.5, 1.0, 2.0, 0.0, 0.0])
    assert race.lost(most).tolist() == [False, False, True, True, False, False]
    # the individuals of a slice of the trials
    assert race[slice(2, 6)].lost(most[2:]).tolist() == [True, True, False, False]
    assert race[slice(0, 2)].lost(most[:2]).tolist() == [False, False]


def test_a_race_lost_by_less_than_rounding_is_not_lost():
    most = np.array([0.1, 0.2, 0.3])
    for below, lost in ((0.0, False), (ROUNDING / 2, False), (2 * ROUNDING, True)):
        race = Race(np.array([0.2 + below]), trials=3)
        assert race.lost(most).tolist() == 3 * [lost]


GENOMES = np.random.default_rng(2).uniform(-5, 5, (12, NETWORK.n_genes))


def evaluated(to_beat: np.ndarray | None, trials: int = 3):
    engine = BatchEngine(SCENE, TASK, 1)
    return evaluate(engine, NETWORK, GENOMES, starts(trials, seed=3), to_beat)


@cache
def without_a_race():
    """To be looked at only, since tests share it."""
    return evaluated(None)


@pytest.mark.parametrize("seed", range(5))
def test_who_beats_what_it_has_to_is_untouched_and_who_does_not_still_loses(seed):
    whole = without_a_race()
    to_beat = np.random.default_rng(seed).permutation(whole.fitness)
    raced = evaluated(to_beat)
    wins = whole.fitness > to_beat
    np.testing.assert_array_equal(raced.fitness > to_beat, wins)
    np.testing.assert_array_equal(raced.trial_fitness[wins], whole.trial_fitness[wins])
    np.testing.assert_array_equal(raced.crashed[wins], whole.crashed[wins])
    assert (raced.steps <= whole.steps).all()
    assert (raced.steps < whole.steps).any()
    # broken off is not crashed
    assert not raced.crashed[raced.steps < whole.steps].any()
    # all trials of an individual are broken off at once
    for i in np.flatnonzero((raced.steps < whole.steps).any(axis=1)):
        ended = raced.steps[i].max()
        assert raced.steps[i].tolist() == np.minimum(whole.steps[i], ended).tolist()


def test_nobody_who_draws_is_broken_off():
    whole = without_a_race()
    raced = evaluated(whole.fitness)
    np.testing.assert_array_equal(raced.steps, whole.steps)
    np.testing.assert_array_equal(raced.trial_fitness, whole.trial_fitness)


@pytest.mark.parametrize("capacity", [3, 4, 5, 7, 35, 36])
def test_chunks_change_nothing_in_a_race(capacity, monkeypatch):
    to_beat = without_a_race().fitness[::-1]
    whole = evaluated(to_beat)
    monkeypatch.setattr(evaluation, "CAPACITY", capacity)
    parts = evaluated(to_beat)
    for field in fields(whole):
        left, right = getattr(whole, field.name), getattr(parts, field.name)
        np.testing.assert_array_equal(left, right, err_msg=field.name)


def test_an_individual_that_does_not_fit_lives(monkeypatch):
    whole = without_a_race()
    monkeypatch.setattr(evaluation, "CAPACITY", 2)
    # to be beaten by nobody
    raced = evaluated(np.full(len(GENOMES), np.inf))
    np.testing.assert_array_equal(raced.trial_fitness, whole.trial_fitness)
    np.testing.assert_array_equal(raced.steps, whole.steps)


# evolution

GENERATIONS = 8


def small(name: str, **update) -> ExperimentConfig:
    """A shipped experiment of few generations, as far as it can be made small."""
    config = load_config(find_config(name))
    optimizer = config.optimizer
    if "population" in {field.name for field in fields(optimizer)}:
        optimizer = replace(optimizer, **{"population": 10})
    for part in ("evolution", "first", "then"):
        if hasattr(optimizer, part):
            smaller = replace(getattr(optimizer, part), population=10)
            optimizer = replace(optimizer, **{part: smaller})
    if name == "openai-es":
        optimizer = replace(optimizer, **{"pairs": 4})
    sizes = {"evaluations": 10 * GENERATIONS, "steps": 40, "trials": 3}
    # of random search few can be broken off, and late
    if name == "random-search":
        sizes |= {"evaluations": 120, "steps": 60}
    # its parents count as well
    if name == "one-plus-one-es":
        sizes |= {"evaluations": 10 * (2 * GENERATIONS - 1)}
    # every other generation is of parents, too
    if name == "ssshc":
        sizes |= {"evaluations": 120}
    # lessons count as well, and refinements are smaller generations
    if name in HYBRIDS:
        sizes |= {"evaluations": 150}
    sizes |= {"validation_starts": 20, "optimizer": optimizer}
    return config.model_copy(update=sizes | update)


def evolved(config: ExperimentConfig, **how) -> Evolution:
    experiment = Evolution(config, threads=1, **how)
    list(experiment.run())
    return experiment


@cache
def small_one(name: str, racing: bool, fitness: str = "product") -> Evolution:
    """`small`, evolved: to be looked at only, since tests share it."""
    experiment = evolved(small(name, fitness=fitness), racing=racing)
    # its robots take a fifth of a gigabyte
    del experiment.engine
    return experiment


def assert_same(a: Evolution, b: Evolution) -> None:
    """Equal to the last bit in all but the cost."""
    assert a.history().encode() == b.history().encode()
    left, right = a.state(), b.state()
    assert list(left) == list(right)
    for key in left.keys() - {"records"}:
        np.testing.assert_array_equal(left[key], right[key], err_msg=key)


def steps_of(experiment: Evolution) -> list[int]:
    return [each.control_steps for each in experiment.records]


CASES = [
    *zip((*OPTIMIZERS, ELITIST), repeat("product"), strict=False),
    *zip(RACES[:2], repeat("literal"), strict=False),
]


@pytest.mark.parametrize(("name", "fitness"), CASES)
def test_racing_changes_nothing_but_the_cost(name, fitness):
    raced, whole = (small_one(name, racing, fitness) for racing in (True, False))
    assert_same(raced, whole)
    assert len(raced.records) >= GENERATIONS
    fast, slow = steps_of(raced), steps_of(whole)
    assert all(a <= b for a, b in zip(fast, slow, strict=True))
    # every fitness of the first population matters
    assert fast[0] == slow[0]
    assert (sum(fast) < sum(slow)) == (name in RACES)
    if name not in RACES:
        assert raced.records == whole.records


def test_chunks_smaller_than_the_population_change_nothing(monkeypatch):
    # trials that are stepped: compiled ones have no chunks
    config = small("de-best", robot="epuck", evaluations=40)
    whole = evolved(config)
    for capacity in (2, 7, 29):
        monkeypatch.setattr(evaluation, "CAPACITY", capacity)
        parts = evolved(config)
        assert_same(parts, whole)
        # as long as an individual fits, as much is saved too
        assert (parts.records == whole.records) == (capacity >= config.trials)


@pytest.mark.parametrize("name", RACES[:2])
def test_dm_control_gives_the_same_bytes_as_a_race(name):
    config = small(name, robot="epuck", evaluations=60, trials=2)
    raced = evolved(config)
    assert_same(raced, evolved(config, engine="dm_control"))
    assert sum(steps_of(raced)) < sum(steps_of(evolved(config, racing=False)))


@pytest.mark.parametrize("name", RACES[:2])
def test_the_same_champion_is_chosen(name):
    chosen = []
    for racing in (True, False):
        experiment = small_one(name, racing)
        engine = BatchEngine(experiment.scene, experiment.config.task, 1)
        chosen.append(choose_champion(engine, experiment, stored_by(experiment)))
    one, other = chosen
    assert one.genome.tobytes() == other.genome.tobytes()
    assert replace(one, genome=other.genome) == other


def test_nothing_is_broken_off_where_parents_are_evaluated_again():
    config = small("de-best")
    optimizer = replace(config.optimizer, **{"reevaluate_parents": True})
    config = config.model_copy(update={"optimizer": optimizer})
    raced, whole = (evolved(config, racing=racing) for racing in (True, False))
    assert_same(raced, whole)
    assert raced.records == whole.records


def test_who_is_not_evaluated_again_races():
    config = small("de-best")
    optimizer = replace(config.optimizer, **{"reevaluate_best": 3})
    config = config.model_copy(update={"optimizer": optimizer})
    raced, whole = (evolved(config, racing=racing) for racing in (True, False))
    assert_same(raced, whole)
    assert sum(steps_of(raced)) < sum(steps_of(whole))


def test_a_race_can_be_begun_and_given_up_on_the_way():
    whole = small_one("de-rand", racing=True)
    config = whole.config
    for first in (True, False):
        begun = Evolution(config, threads=1, racing=first)
        list(islice(begun.run(), 4))
        resumed = Evolution(config, threads=1, racing=not first)
        resumed.restore(begun.state())
        list(resumed.run())
        assert_same(resumed, whole)
