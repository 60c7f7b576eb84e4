"""Learning rules: what genomes become by a lesson.

Each rule spends `COST` evaluations on every learner and moves its genome by `step` at
most, so that rules can be compared. Genomes stay within their bounds.

Source:
    policy gradient: R. J. Williams, Machine Learning 8 (1992) 229-256 (REINFORCE), with
    reward to go and a baseline. Lessons, steps and baseline are this project's choices.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from epuck_mj.policies.gradient import gradient, in_all_steps, squashing_slope
from epuck_mj.policies.network import Network
from evolution.search.lessons import Lessons, Life
from evolution.search.search_space import SearchSpace

COST = 2
"""Evaluations that a lesson costs each learner."""

IMITATION_STEPS = 10
"""Number of gradient steps in one lesson of imitation."""

EVERY = 10
"""An imitator uses one of this number of control steps: neighbours are alike."""


@dataclass(frozen=True)
class Rule:
    """How far and with what a rule learns.

    Attributes:
        step: length of the change of a genome.
        exploration: standard deviation of what a policy gradient tries.
        discount: of a reward one control step later.
    """

    step: float
    exploration: float
    discount: float


@dataclass(frozen=True)
class Given:
    """What a rule is given beside the learners' genomes.

    Attributes:
        best: genome of the best individual, `(genes,)`.
        lessons: that the learners may live.
        rule: how far and with what it learns.
        space: whose bounds genomes keep.
        rng: the source of its randomness.
    """

    best: np.ndarray
    lessons: Lessons
    rule: Rule
    space: SearchSpace
    rng: Generator


def reward_to_go(reward: np.ndarray, discount: float) -> np.ndarray:
    """Discounted sum `(..., steps)` of the rewards `(..., steps)` from each step on."""
    sums = np.empty_like(reward)
    later = np.zeros(reward.shape[:-1])
    for k in reversed(range(reward.shape[-1])):
        later = reward[..., k] + discount * later
        sums[..., k] = later
    return sums


def policy_gradient(
    network: Network, genomes: np.ndarray, life: Life, rule: Rule
) -> np.ndarray:
    """Estimated gradients `(n, genes)` of the discounted reward.

    The baseline of a step is the mean over a learner's trials at the same step.

    Args:
        network: that genomes decode to.
        genomes: of the learners, `(n, genes)`.
        life: of each, with exploration.
        rule: what was tried, and the discount.
    """
    to_go = reward_to_go(life.reward, rule.discount)
    advantage = np.where(life.lived, to_go - to_go.mean(axis=1, keepdims=True), 0.0)
    # derivative of the logarithm of a normal distribution's density by its mean
    by_sums = advantage[..., None] * life.tried / rule.exploration**2
    n = len(genomes)
    return gradient(
        network,
        network.decode(genomes),
        life.observation.reshape(n, -1, life.observation.shape[-1]),
        by_sums.reshape(n, -1, by_sums.shape[-1]),
    )


def imitation_gradient(
    network: Network, genomes: np.ndarray, observation: np.ndarray, action: np.ndarray
) -> np.ndarray:
    """Gradients `(n, genes)` of minus half the squared difference of actions.

    Args:
        network: that genomes decode to.
        genomes: `(n, genes)`.
        observation: of each, `(n, m, 8)`.
        action: what a teacher does then, `(n, m, 2)`; NaN where it does not matter.
    """
    controllers = network.decode(genomes)
    own = in_all_steps(controllers)(observation)
    missing = np.where(np.isnan(action), 0.0, action - own)
    return gradient(network, controllers, observation, missing * squashing_slope(own))


def moved(
    genomes: np.ndarray, direction: np.ndarray, step: float, space: SearchSpace
) -> np.ndarray:
    """Genomes `(n, genes)` a step along their directions `(n, genes)`, in bounds.

    One without a direction stays where it is.
    """
    length = np.sqrt((direction.T**2).sum(axis=0))[:, None]
    unit = direction / np.where(length > 0, length, 1.0)
    return np.clip(genomes + step * unit, space.lower, space.upper)


def by_policy_gradient(genomes: np.ndarray, given: Given) -> np.ndarray:
    """One step along the policy gradient, from trials lived twice on each start."""
    life = given.lessons.live(np.repeat(genomes, COST, axis=0), given.rule.exploration)
    own = life.of(len(genomes))
    direction = policy_gradient(given.lessons.network, genomes, own, given.rule)
    return moved(genomes, direction, given.rule.step, given.space)


def by_imitation(genomes: np.ndarray, given: Given) -> np.ndarray:
    """Several small steps towards the actions that the best would take instead."""
    network = given.lessons.network
    lives = [given.lessons.live(genomes, 0.0) for _ in range(COST)]
    seen = np.concatenate([life.observation for life in lives], axis=1)[:, :, ::EVERY]
    lived = np.concatenate([life.lived for life in lives], axis=1)[:, :, ::EVERY]
    observation = seen.reshape(len(genomes), -1, seen.shape[-1])
    action = network.decode(given.best)(observation)
    action[~lived.reshape(len(genomes), -1)] = np.nan
    step = given.rule.step / IMITATION_STEPS
    for _ in range(IMITATION_STEPS):
        direction = imitation_gradient(network, genomes, observation, action)
        genomes = moved(genomes, direction, step, given.space)
    return genomes


def by_perturbation(genomes: np.ndarray, given: Given) -> np.ndarray:
    """The better of a step in a random direction and one against it.

    The control of the other rules: the same trials and the same step, without what can
    be learnt from single control steps.
    """
    direction = given.rng.normal(size=genomes.shape)
    step, space = given.rule.step, given.space
    pair = [moved(genomes, sign * direction, step, space) for sign in (1, -1)]
    fitness = given.lessons.live(np.concatenate(pair), 0.0).fitness
    ahead, against = np.split(fitness, 2)
    return np.where((ahead >= against)[:, None], *pair)


Learn = Callable[[np.ndarray, Given], np.ndarray]
# (genomes (n, genes) of the learners, what it is given) -> learned (n, genes)
LEARNING_RULES: Mapping[str, Learn] = {
    "policy_gradient": by_policy_gradient,
    "imitation": by_imitation,
    "perturbation": by_perturbation,
}
