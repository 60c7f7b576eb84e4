"""Lessons: what learners live, what it costs, and that they learn."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.policies.exploring import Exploring
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import compiled_trials, robots_in
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record_lessons
from evolution.judging.evaluation import BatchEngine, evaluate
from evolution.judging.lessons import Circumstances, GivenLessons, LessonRobots
from evolution.run.generation_loop import Evolution
from evolution.search import imitators
from evolution.search.ask_tell import AskTellError, Optimizer
from evolution.search.imitators import Imitators, ImitatorsParameters
from evolution.search.learning_rules import COST, LEARNING_RULES, Given, Rule
from evolution.search.lessons import Lessons
from evolution.search.policy_gradient import PolicyGradient, PolicyGradientParameters
from evolution.search.search_space import SearchSpace
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.study.addresses import champion_at
from tests.shipped import CHAMPION, HYBRIDS

TASK = TaskParameters(steps=60)
NETWORK = Network()
SPACE = SearchSpace(NETWORK.n_genes, -5, 5, -5, 5)


def given(scene, trials: int = 3, seed: int = 0, task=TASK) -> GivenLessons:
    space = FreeSpace(scene, 0.01)

    def circumstances(number: int, trials: int) -> Circumstances:
        rng = np.random.default_rng([seed, number])
        return Circumstances(space.sample(rng, trials), None, rng)

    return GivenLessons(LessonRobots(scene, task, 1), NETWORK, circumstances, trials)


def genomes(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-5, 5, (n, NETWORK.n_genes))


@pytest.mark.parametrize("noise", ["none", "strong"])
def test_compiled_lessons_have_the_bits_of_the_loop(kinematic, noise):
    n = 30
    rng = np.random.default_rng(1)
    policy = NETWORK.decode(genomes(n))
    starts = FreeSpace(kinematic, 0.01).sample(rng, n)
    met = Conditions(noise).draw(rng, n, TASK.steps)
    tried = rng.normal(0, 0.7, (n, TASK.steps, 2))
    compiled = compiled_trials(kinematic, TASK, 2)
    assert compiled is not None
    fast = compiled.explored(policy, starts, met, tried)
    robots = robots_in(kinematic, 7)
    slow = record_lessons(robots, Exploring(policy, tried), starts, TASK, met)
    for one, other in zip(fast[1:], slow[1:], strict=True):
        np.testing.assert_array_equal(one, other)
    for name in ("fitness", "steps", "crashed"):
        got = getattr(fast[0], name), getattr(slow[0], name)
        np.testing.assert_array_equal(*got)
    assert 0 < fast[0].crashed.sum() < n
    np.testing.assert_allclose(fast[2].sum(axis=1), fast[0].fitness)


def test_nothing_tried_is_an_evaluation(scene):
    lessons = given(scene)
    life = lessons.live(genomes(6), 0.0)
    starts = FreeSpace(scene, 0.01).sample(np.random.default_rng([0, 1]), 3)
    evaluation = evaluate(BatchEngine(scene, TASK, 1), NETWORK, genomes(6), starts)
    np.testing.assert_array_equal(life.fitness, evaluation.fitness)
    np.testing.assert_array_equal(life.lived.sum(axis=-1), evaluation.steps)
    assert lessons.cost == 6
    assert lessons.control_steps == evaluation.steps.sum()
    # what was not lived is 0
    assert (life.observation[~life.lived] == 0).all()
    assert (life.reward[~life.lived] == 0).all()


def test_lessons_differ_and_repeat(kinematic):
    lessons = given(kinematic)
    first, second = (lessons.live(genomes(2), 0.5) for _ in range(2))
    again = given(kinematic).live(genomes(2), 0.5)
    np.testing.assert_array_equal(first.observation, again.observation)
    np.testing.assert_array_equal(first.tried, again.tried)
    assert (first.observation[:, :, 0] != second.observation[:, :, 0]).any()


def test_a_demonstration_is_the_wall_followers(scene):
    lessons = given(scene)
    shown = lessons.demonstrate(2)
    assert lessons.cost == 2
    assert len(shown.observation) == lessons.control_steps == 2 * 3 * TASK.steps
    action = WallFollower()(shown.observation)
    np.testing.assert_array_equal(shown.action, action)


@pytest.mark.parametrize("name", LEARNING_RULES)
def test_a_rule_costs_what_it_says_and_moves_at_most_a_step(kinematic, name):
    lessons, before = given(kinematic), genomes(5)
    rng, rule = np.random.default_rng(0), Rule(0.5, 0.3, 0.95)
    learn = LEARNING_RULES[name]
    after = learn(before, Given(genomes(1, 7)[0], lessons, rule, SPACE, rng))
    assert lessons.cost == COST * 5
    assert after.min() >= -5 and after.max() <= 5
    moved = np.linalg.norm(after - before, axis=1)
    assert (moved <= 0.5 + 1e-12).all()
    assert (moved > 0).any()


@pytest.mark.parametrize("name", LEARNING_RULES)
def test_learning_improves_controllers(kinematic, name):
    task, rng = TaskParameters(), np.random.default_rng(0)
    best = np.asarray(champion_at(CHAMPION).genome)
    before = np.clip(best + rng.normal(0, 0.4, (8, len(best))), -5, 5)
    starts = FreeSpace(kinematic, 0.01).sample(np.random.default_rng(99), 100)
    engine = BatchEngine(kinematic, task, 2)

    def fitness(genomes: np.ndarray) -> float:
        return float(evaluate(engine, NETWORK, genomes, starts).fitness.mean())

    after, lessons = before, given(kinematic, trials=5, task=task)
    for _ in range(15):
        rule = Rule(0.3, 1.0, 0.9)
        given_now = Given(best, lessons, rule, SPACE, rng)
        after = LEARNING_RULES[name](after, given_now)
    assert fitness(after) > 1.3 * fitness(before)


def test_imitators_act_as_their_teacher(kinematic):
    imitators = Imitators(ImitatorsParameters(4, 10), SPACE, np.random.default_rng(0))
    cost = imitators.next_cost()
    before = imitators.ask()
    lessons = given(kinematic, 5, task=TaskParameters())
    imitators.learn_in_life(lessons)
    assert lessons.cost == cost - 4 == 10
    seen = given(kinematic, 5, seed=1).demonstrate(10)

    def error(some: np.ndarray) -> np.ndarray:
        controllers = NETWORK.decode(some)
        actions = [controllers[i](seen.observation) for i in range(len(some))]
        return ((np.array(actions) - seen.action) ** 2).mean(axis=(1, 2))

    assert (error(imitators.pending()) < 0.3 * error(before)).all()
    imitators.tell(np.zeros(4))
    assert imitators.next_cost() == 4


def short(name: str, **keys) -> ExperimentConfig:
    config = load_config(find_config(name))
    return config.model_copy(
        update={"steps": 40, "trials": 2, "finalists": 0, "climb": 1.0} | keys
    )


RUNS = {
    **{name: short(name, evaluations=700) for name in HYBRIDS},
    "policy-gradient": short("policy-gradient", evaluations=200),
    "baldwinian": short("lifetime-learning", evaluations=700),
}
_learning = RUNS["baldwinian"].optimizer
for _rule in ("imitation", "perturbation"):
    RUNS[_rule] = RUNS["baldwinian"].model_copy(
        update={"optimizer": replace(_learning, rule=_rule)}
    )
RUNS["baldwinian"] = RUNS["baldwinian"].model_copy(
    update={"optimizer": replace(_learning, inheritance="baldwinian")}
)


@pytest.mark.parametrize("name", RUNS)
def test_runs_resume_and_are_independent_of_threads(name, monkeypatch):
    config = RUNS[name]
    # how well imitators learn is another test's question
    monkeypatch.setattr(imitators, "FIT_STEPS", 20)
    whole, interrupted = Evolution(config, threads=1), Evolution(config, threads=3)
    list(whole.run())
    for _ in itertools.islice(interrupted.run(), 2):
        pass
    assert not interrupted.finished
    resumed = Evolution(config, threads=2)
    resumed.restore(interrupted.state())
    list(resumed.run())
    assert resumed.history() == whole.history()
    for key, array in whole.state().items():
        np.testing.assert_array_equal(resumed.state()[key], array, err_msg=key)
    left = config.evaluations - whole.evaluations
    assert 0 <= left < whole.optimizer.next_cost()


def test_lessons_on_wheels_after_the_climb():
    config = short("lifetime-learning", evaluations=1200, climb=0.5, steps=10)
    evolution = Evolution(config, threads=2)
    records = list(evolution.run())
    assert not records[0].climbed and records[-1].climbed
    again = Evolution(config, threads=1)
    list(again.run())
    assert again.history() == evolution.history()


class Greedy(Optimizer):
    """An optimiser that lives lessons which it has not announced."""

    needs_lessons = True

    def __init__(self) -> None:
        super().__init__("greedy", genomes(3), np.random.default_rng(0))

    def next_cost(self) -> int:
        return 4

    def learn_in_life(self, lessons: Lessons) -> None:
        lessons.live(self.pending(), 0.0)

    def propose(self) -> np.ndarray:
        return self.population

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        pass


def test_lessons_that_are_not_paid_are_refused():
    evolution = Evolution(short("policy-gradient"), threads=1)
    evolution.optimizer = Greedy()
    with pytest.raises(AskTellError, match="expected lessons of 1 evaluations, got 3"):
        next(evolution.run())


def test_a_network_without_gradients_is_refused(tmp_path):
    (tmp_path / "mine.py").write_text(
        "class Mine:\n    n_genes = 3\n    n_state = 0\n"
        "    def act(self, genomes, observation, state):\n"
        "        return observation[..., :2] * 0, state\n"
    )
    config = short("policy-gradient", network=f"{tmp_path}/mine.py:Mine")
    with pytest.raises(UserError, match="expected network feedforward"):
        Evolution(config)


def test_policy_gradient_resumes_its_adam():
    first = PolicyGradient(
        PolicyGradientParameters(batch=2), SPACE, np.random.default_rng(0)
    )
    scene = load_scene("epuck_kinematic", "arena", 0.1)
    for optimizer in (first,):
        optimizer.ask()
        optimizer.learn_in_life(given(scene))
        optimizer.tell([1.0])
    other = PolicyGradient(
        PolicyGradientParameters(batch=2), SPACE, np.random.default_rng(5)
    )
    other.restore(first.state())
    for optimizer in (first, other):
        optimizer.ask()
        optimizer.learn_in_life(given(scene, seed=3))
        optimizer.tell([2.0])
    np.testing.assert_array_equal(first.population, other.population)
