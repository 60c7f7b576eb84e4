"""Lessons: trials in which individuals learn before they are evaluated.

The generation loop gives them, and each is paid from the budget: a genome that lives a
lesson costs as much as one that is evaluated.
"""

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from epuck_mj.policies.network import Network


@dataclass(frozen=True, eq=False)
class Life:
    """Trials that genomes `(n,)` lived in a lesson; 0 after a trial's end.

    Attributes:
        observation: at the beginning of each control step, `(n, trials, steps, 8)`.
        tried: see `Exploring`, `(n, trials, steps, 2)`.
        reward: step fitness, `(n, trials, steps)`.
        lived: which control steps there were, `(n, trials, steps)`.
    """

    observation: np.ndarray
    tried: np.ndarray
    reward: np.ndarray
    lived: np.ndarray

    def of(self, learners: int) -> Self:
        """The same trials by learner; copies of a learner follow one another."""
        each = (self.observation, self.tried, self.reward, self.lived)
        return type(self)(
            *(array.reshape(learners, -1, *array.shape[2:]) for array in each)
        )

    @property
    def fitness(self) -> np.ndarray:
        """Mean over the trials of the sum of the step fitness, `(n,)`."""
        return self.reward.cumsum(axis=-1)[..., -1].mean(axis=-1)


@dataclass(frozen=True, eq=False)
class Demonstration:
    """What a teacher saw and did in control steps `(m,)`.

    Attributes:
        observation: `(m, 8)`.
        action: `(m, 2)`.
    """

    observation: np.ndarray
    action: np.ndarray


class Lessons(Protocol):
    """Lessons of one generation."""

    @property
    def network(self) -> Network:
        """What genomes decode to."""
        ...

    def live(self, genomes: np.ndarray, exploration: float) -> Life:
        """Trials of genomes `(n, genes)`, all on the same new starts.

        Costs as much as `n` evaluations.

        Args:
            genomes: of the learners.
            exploration: standard deviation of what is added to the sums of v and w.
        """
        ...

    def demonstrate(self, evaluations: int) -> Demonstration:
        """The hand-written wall follower, in as many trials as evaluations have."""
        ...
