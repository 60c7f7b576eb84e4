"""A sequence: one search begins, another goes on from what it has found.

After a share of the budget the second begins with the individuals of the first: a
differential evolution with all of them, a CMA-ES at the best of them. The first may be
imitators, which are done after one generation.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from epuck_mj.host.command_line import PART
from epuck_mj.host.limits import check
from evolution.search.ask_tell import (
    Optimizer,
    checked_state,
    generator_state,
    part_of,
    restored_generator,
)
from evolution.search.cma_es import CmaEs, CmaEsParameters
from evolution.search.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionParameters,
)
from evolution.search.imitators import Imitators, ImitatorsParameters
from evolution.search.lessons import Lessons
from evolution.search.search_space import SearchSpace


@dataclass(frozen=True)
class SequenceParameters:
    """Parameters of a sequence.

    Attributes:
        first: parameters of the search that begins: differential evolution, CMA-ES or
            imitators.
        then: parameters of the search that goes on: differential evolution, with as
            many individuals as the first, or CMA-ES.
        share: share of the evaluations that the first search spends, 0 to 1; at
            least one generation.
        budget: evaluations of both together; 0 is the run's.
        algorithm: the algorithm's name in configurations.

    Raises:
        ValueError: a value out of its range.
    """

    first: Annotated[
        DifferentialEvolutionParameters | CmaEsParameters | ImitatorsParameters, PART
    ]
    then: Annotated[DifferentialEvolutionParameters | CmaEsParameters, PART]
    share: float = 0.8
    budget: int = 0
    algorithm: Literal["sequence"] = "sequence"
    # the configuration reads this: a misspelt key is refused
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        """Refuse values out of range, and populations that do not fit."""
        check("share", self.share)
        check("budget", self.budget)
        if isinstance(self.then, DifferentialEvolutionParameters):
            n, first = self.then.population, self.first.population
            if n != first:
                raise ValueError(
                    f"then.population: expected {first}, as many as the first has, "
                    f"got {n}"
                )
            if isinstance(self.first, CmaEsParameters) and self.first.restarts:
                raise ValueError(
                    "first.restarts: expected false before a differential evolution, "
                    "since restarts change the number of individuals, got true"
                )


def _made(
    parameters: DifferentialEvolutionParameters | CmaEsParameters | ImitatorsParameters,
    space: SearchSpace,
    rng: Generator,
) -> Optimizer:
    if isinstance(parameters, DifferentialEvolutionParameters):
        return DifferentialEvolution(parameters, space, rng)
    if isinstance(parameters, CmaEsParameters):
        return CmaEs(parameters, space, rng)
    return Imitators(parameters, space, rng)


class Sequence(Optimizer):
    """The optimiser 'sequence'.

    Attributes:
        now: the search that asks and is told, whose population and fitness are its own.
    """

    def __init__(
        self, parameters: SequenceParameters, space: SearchSpace, rng: Generator
    ) -> None:
        """Begin with the first search; `rng` belongs to the optimiser from here on."""
        if not parameters.budget:
            raise ValueError("budget: expected the number of evaluations, got 0")
        own, then = rng.spawn(2)
        # the second search depends only on its parameters and this
        self._birth = generator_state(then)
        # the same first population as without
        self._parts = (
            _made(parameters.first, space, rng),
            _made(parameters.then, space, then),
        )
        self.now = self._parts[0]
        super().__init__("sequence", self.now.population, own)
        self.growth = max(part.growth for part in self._parts)
        self.stores_means = any(part.stores_means for part in self._parts)
        self.needs_lessons = self.now.needs_lessons
        self._parameters, self._space = parameters, space
        self._spent = 0

    def next_size(self) -> int:
        """See `Optimizer.next_size`."""
        return self.now.next_size()

    def next_cost(self) -> int:
        """See `Optimizer.next_cost`."""
        return self.now.next_cost()

    def ask(self) -> np.ndarray:
        """See `Optimizer.ask`: what the present search asks."""
        self._refuse_pending("ask")
        self._asked = self.propose()
        return self._asked.copy()

    def propose(self) -> np.ndarray:
        """What the present search asks, the first population as well."""
        return self.now.ask()

    def learn_in_life(self, lessons: Lessons) -> None:
        """See `Optimizer.learn_in_life`."""
        self.now.learn_in_life(lessons)
        self._asked = self.now.pending()

    def to_beat(self) -> np.ndarray:
        """See `Optimizer.to_beat`."""
        self.pending()
        return self.now.to_beat()

    def learn(self, asked: np.ndarray, told: np.ndarray) -> None:
        """Tell the present search; go on with the next when its share is spent."""
        self._spent += self.now.next_cost()
        self.now.tell(told)
        self.population, self.fitness = self.now.population, self.now.fitness
        first, then = self._parts
        due = self._spent >= self._parameters.share * self._parameters.budget
        if due and self.now is first:
            then.begin_with(self.population, self.fitness)
            self.now = then

    def judge_anew(self, fitness: ArrayLike) -> None:
        """See `Optimizer.judge_anew`."""
        super().judge_anew(fitness)
        if self.now.generation:
            self.now.judge_anew(fitness)

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """See `Optimizer.restore`."""
        # the second search may have more or fewer individuals
        n, own = np.size(state.get("fitness", 0.0)), self._own_arrays()
        own |= {"population": np.empty((n, self._space.genes)), "fitness": np.empty(n)}
        arrays = checked_state(state, like=own)
        rng = restored_generator(self.rng, arrays["generator"])
        born = restored_generator(self.rng, arrays["birth"])
        then = _made(self._parameters.then, self._space, born)
        parts = self._parts[0], then
        part = parts[int(arrays["went_on"])]
        if part is then:
            then.begin_with(arrays["population"], arrays["fitness"])
        needed = part.arrays_inside("now")
        if missing := [key for key in needed if key not in state]:
            expected = ", ".join([*own, *needed])
            raise ValueError(f"state lacks {', '.join(missing)}; expected {expected}")
        part.restore(part_of(state, "now"))
        self._parts, self.now, self.rng = parts, part, rng
        self._birth = arrays["birth"]
        self.generation, self._spent = int(arrays["generation"]), int(arrays["spent"])
        self._asked = None
        self.load(arrays)

    def arrays(self) -> dict[str, np.ndarray]:
        """See `Optimizer.arrays`."""
        return {**self._own_arrays(), **self.now.arrays_inside("now")}

    def _own_arrays(self) -> dict[str, np.ndarray]:
        """Arrays beside those of the present search."""
        return {
            **super().arrays(),
            "birth": self._birth.copy(),
            "spent": np.array(self._spent),
            "went_on": np.array(self.now is self._parts[1]),
        }
