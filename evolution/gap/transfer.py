"""Transfer of champions: fitness, crashes, shares kept, ranks, with uncertainties."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evolution.gap.outcomes import Outcome
from evolution.statistics.estimates import (
    Interval,
    mean_interval,
    rank_correlation,
    wilson,
)

SHARE_KEPT = 0.8
"""Least share of its fitness that a policy keeps in a world it masters."""

COLLISIONS_MAX = 1.0
"""Collisions per minute from which on a policy has not mastered a world."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """Fitness and collisions of policies `(p,)` in worlds `(w,)`.

    Attributes:
        nominal: mean step fitness of ideal robots where they evolved, `(p,)`.
        reference: what it is measured against in each world, `(w, p)`: the nominal
            fitness, or that of an ideal robot in the world's arena if that is more.
            Else a small arena, where walls are soon found, would hide what sensors and
            motors cost.
        fitness: mean step fitness in each world, `(w, p)`.
        collisions: per minute, `(w, p)`.
        crash_rate: share of the trials that ended in a crash, `(w, p)`.
    """

    nominal: np.ndarray
    reference: np.ndarray
    fitness: np.ndarray
    collisions: np.ndarray
    crash_rate: np.ndarray

    @classmethod
    def of(
        cls,
        nominal: Sequence[Outcome],
        ideal: Sequence[Sequence[Outcome]],
        in_worlds: Sequence[Sequence[Outcome]],
    ) -> "Transfer":
        """The transfer that was measured.

        Args:
            nominal: an outcome per policy.
            ideal: for each world, those on ideal robots in its arena.
            in_worlds: for each world, those in it.
        """
        own = np.array([outcome.fitness for outcome in nominal])
        there = np.array([[o.fitness for o in world] for world in ideal])
        return cls(
            own,
            np.maximum(own, there),
            np.array([[o.fitness for o in world] for world in in_worlds]),
            np.array([[o.collisions_per_minute for o in world] for world in in_worlds]),
            np.array([[o.crash_rate for o in world] for world in in_worlds]),
        )

    @property
    def share(self) -> np.ndarray:
        """Share of the reference that each policy keeps, `(w, p)`; 0 of none."""
        return _share(self.fitness, self.reference)

    @property
    def mastered(self) -> np.ndarray:
        """Which worlds each policy masters, `(w, p)`."""
        return self._mastered(self.share)

    @property
    def mastered_against_nominal(self) -> np.ndarray:
        """Which worlds each policy masters against its nominal fitness, `(w, p)`."""
        return self._mastered(_share(self.fitness, self.nominal))

    def _mastered(self, share: np.ndarray) -> np.ndarray:
        return (share >= SHARE_KEPT) & (self.collisions < COLLISIONS_MAX)


@dataclass(frozen=True, eq=False)
class Gap:
    """Policies in the same worlds of one kind on each robot.

    Attributes:
        kind: of the worlds, a name in `worlds.KINDS`.
        names: of the policies.
        transfers: by robot, at least one.
        groups: indices of the policies of each experiment.
        peers: indices of the policies of each speed.
        starts: of each world, and in nominal conditions.
        latency: of each world, in control steps, `(w,)`.
    """

    kind: str
    names: Sequence[str]
    transfers: Mapping[str, Transfer]
    groups: Mapping[str, Sequence[int]]
    peers: Mapping[str, Sequence[int]]
    starts: int
    latency: np.ndarray


@dataclass(frozen=True)
class Verdict:
    """Summary of one policy in all worlds.

    Attributes:
        nominal: mean step fitness of ideal robots where it evolved.
        fitness: mean step fitness in the worlds.
        crash_rate: mean share of the trials there that ended in a crash.
        share: mean share kept over the worlds.
        median_share: median over the worlds.
        collisions: mean per minute over the worlds.
        mastered: share of the worlds that were mastered.
    """

    nominal: float
    fitness: Interval
    crash_rate: Interval
    share: Interval
    median_share: float
    collisions: Interval
    mastered: Interval


def verdict(transfer: Transfer, policy: int) -> Verdict:
    """Summarise one policy in all worlds."""
    rng = np.random.default_rng(0)
    share, mastered = transfer.share[:, policy], transfer.mastered[:, policy]
    return Verdict(
        nominal=float(transfer.nominal[policy]),
        fitness=mean_interval(transfer.fitness[:, policy], rng),
        crash_rate=mean_interval(transfer.crash_rate[:, policy], rng),
        share=mean_interval(share, rng),
        median_share=float(np.median(share)),
        collisions=mean_interval(transfer.collisions[:, policy], rng),
        mastered=wilson(int(mastered.sum()), len(mastered)),
    )


def rank_correlations(
    transfer: Transfer, members: Sequence[int]
) -> dict[str, float] | None:
    """Spearman's rank correlations of policies; None if there are too few.

    `nominal`: between nominal fitness and a world, the mean over the worlds. `worlds`:
    between two worlds, the mean over all pairs. Worlds where all fare alike say
    nothing.
    """
    nominal, fitness = transfer.nominal[members], transfer.fitness[:, members]
    found = [rank_correlation(nominal, world) for world in fitness]
    own = [each for each in found if each is not None]
    if len(own) < 2:
        return None
    from scipy import stats

    told = fitness[np.ptp(fitness, axis=1) > 0]
    between = np.corrcoef(stats.rankdata(told, axis=1))
    return {
        "nominal": float(np.mean(own)),
        "worlds": float(between[np.triu_indices(len(told), 1)].mean()),
    }


def between_robots(
    one: Transfer, other: Transfer, members: Sequence[int]
) -> float | None:
    """Spearman's correlation of policies' mean fitness in the worlds on two robots."""
    mean, others = (each.fitness.mean(axis=0)[members] for each in (one, other))
    return rank_correlation(mean, others)


def _share(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    return part / np.maximum(whole, np.finfo(float).tiny)
