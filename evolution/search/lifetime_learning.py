"""Lifetime learning: some individuals of an evolution learn before they are evaluated.

In each generation as many of the genomes asked as the share of the budget allows,
drawn at random, live a lesson. What is evaluated is what they have become. With
Lamarckian inheritance that is also what evolution goes on with; with Baldwinian
inheritance evolution keeps the genome of birth, and the fitness after learning.

Source:
    G. Hinton and S. Nowlan, Complex Systems 1 (1987) 495-502, for what learning may do
    to evolution; D. Whitley, V. S. Gordon and K. Mathias, PPSN III (1994) 6-15, for the
    two kinds of inheritance.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.random import Generator

from epuck_mj.host.command_line import PART
from epuck_mj.host.limits import check
from evolution.search.around_evolution import AroundEvolution
from evolution.search.differential_evolution import DifferentialEvolutionParameters
from evolution.search.learning_rules import COST, LEARNING_RULES, Given, Rule
from evolution.search.lessons import Lessons
from evolution.search.search_space import SearchSpace

INHERITANCES = ("lamarckian", "baldwinian")


@dataclass(frozen=True)
class LifetimeLearningParameters:
    """Parameters of lifetime learning.

    Attributes:
        evolution: parameters of the differential evolution whose individuals learn.
        rule: policy_gradient (explore and follow the reward), imitation (of what the
            best individual would do) or perturbation (try a random change).
        inheritance: lamarckian (what was learnt is inherited) or baldwinian (only its
            fitness counts).
        learning_share: share of the evaluations that lessons cost, from 0 to 2/3
            (every individual learns).
        step: length of the change of a genome by a lesson.
        exploration: standard deviation of the noise that is added to the weighted
            sums of v and w.
        discount: factor of a reward one control step later.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range or an unknown name.
    """

    evolution: Annotated[DifferentialEvolutionParameters, PART]
    rule: str = "policy_gradient"
    inheritance: str = "lamarckian"
    learning_share: float = 0.3
    step: float = 0.3
    exploration: float = 1.0
    discount: float = 0.9
    algorithm: Literal["lifetime_learning"] = "lifetime_learning"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name, known in (("rule", LEARNING_RULES), ("inheritance", INHERITANCES)):
            if getattr(self, name) not in known:
                raise ValueError(
                    f"unknown {name} {getattr(self, name)!r}; "
                    f"available: {', '.join(known)}"
                )
        for name in ("learning_share", "step", "exploration", "discount"):
            check(name, getattr(self, name))


class LifetimeLearning(AroundEvolution):
    """The optimiser 'lifetime-learning': a differential evolution with lessons."""

    needs_lessons = True

    def __init__(
        self,
        parameters: LifetimeLearningParameters,
        space: SearchSpace,
        rng: Generator,
    ) -> None:
        """Draw the first population; `rng` belongs to the optimiser from here on."""
        super().__init__("lifetime-learning", parameters.evolution, space, rng)
        self._parameters = parameters
        self._rule = Rule(parameters.step, parameters.exploration, parameters.discount)

    def next_cost(self) -> int:
        """See `Optimizer.next_cost`."""
        return self.next_size() + COST * self._learners()

    def _learners(self) -> int:
        """Number of individuals that learn in the next generation; none in the first.

        Individuals that are only evaluated again do not learn.
        """
        if self.generation == 0:
            return 0
        share, n = self._parameters.learning_share, len(self.population)
        return min(n, round(self.next_size() * share / (1 - share) / COST))

    def learn_in_life(self, lessons: Lessons) -> None:
        """See `Optimizer.learn_in_life`."""
        learners, asked = self._learners(), self.pending().copy()
        if not learners:
            return
        n = len(self.population)
        chosen = np.sort(self.rng.choice(n, learners, replace=False)) + len(asked) - n
        given = Given(
            best=self.population[np.argmax(self.fitness)],
            lessons=lessons,
            rule=self._rule,
            space=self._space,
            rng=self.rng,
        )
        learn = LEARNING_RULES[self._parameters.rule]
        asked[chosen] = learn(asked[chosen], given)
        self.replace_pending(asked)

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Tell evolution; with Lamarckian inheritance, of the genomes as they became.

        The champion is then a genome that was learnt, otherwise one of birth.
        """
        if self.generation and self._parameters.inheritance == "lamarckian":
            self.evolution.replace_pending(asked)
        super().learn(asked, told)
