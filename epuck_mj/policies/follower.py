"""A wall follower by rule, whose numbers evolve: 13 genes instead of weights.

It keeps walls on its right. It slows down for what is ahead, turns away from what is
near ahead, and else steers by its right side: by how far the reading is from a set
value, and by how it has changed since the last control step. Where it sees no wall, it
searches for one on a wide arc.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from epuck_mj.policies.changes import WithChanges
from epuck_mj.policies.network import genomes_of

AHEAD_RIGHT, DIAGONAL, SIDE, LEFT_DIAGONAL, AHEAD_LEFT = 0, 1, 2, 6, 7
"""Indices of the sensors that it uses: ps0, ps1, ps2, ps6, ps7."""

GENE_MAX = 5.0
"""A gene from minus to plus this is a number from its lowest to its highest. Chosen."""


class Range(NamedTuple):
    """Lowest and highest value of a number."""

    low: float
    high: float


NUMBERS: dict[str, Range] = {
    # reading ahead at which it would stop
    "near": Range(-0.5, 0.5),
    # the reading ahead is by so much larger where it drives at full speed
    "slow": Range(0.05, 1.5),
    # least speed forward
    "creep": Range(0.0, 0.5),
    # reading ahead below which it turns away
    "avoid": Range(0.0, 1.0),
    # turn rate to the left with which it does
    "away": Range(0.0, 1.0),
    # added to the reading of the left diagonal, which counts as ahead
    "left": Range(0.0, 0.5),
    # share of the right diagonal in the side reading; the rest is the right's
    "diagonal": Range(0.0, 1.0),
    # side reading that it steers for
    "target": Range(0.0, 1.0),
    # turn rate for a side reading that is larger by 1
    "gain": Range(0.0, 4.0),
    # turn rate for a side reading that has grown by 1 in a control step
    "damping": Range(0.0, 20.0),
    # highest turn rate, either way, while it steers
    "turn": Range(0.0, 1.0),
    # side reading from which on it sees no wall
    "lost": Range(0.3, 1.0),
    # turn rate to the right where it sees none
    "search": Range(0.0, 0.5),
}
"""The numbers, in the order of the genes. The ranges are chosen.

Readings are from 0, near, to 1, where the sensors' range ends. Speeds and turn rates
are shares of the full ones.
"""


@dataclass(frozen=True)
class Follower:
    """The wall follower whose numbers are genes; a topology."""

    @property
    def n_genes(self) -> int:
        """Number of genes."""
        return len(NUMBERS)

    def to_dict(self) -> dict[str, Any]:
        """The topology as written in controller files: names and ranges of genes."""
        return {"follower": {name: list(each) for name, each in NUMBERS.items()}}

    def decode(self, genomes: np.ndarray) -> WithChanges:
        """The controllers of genomes `(..., 13)`; see `numbers_of`.

        Raises:
            ValueError: if the genomes have another length.
        """
        genomes = genomes_of(genomes, self.n_genes, "follower")
        return WithChanges(Rule(numbers_of(genomes)), alike=genomes.ndim == 1)


def numbers_of(genomes: np.ndarray) -> np.ndarray:
    """The numbers `(13, ...)` of genomes `(..., 13)`, in the order of `NUMBERS`.

    Genes beyond `GENE_MAX` are as `GENE_MAX`.
    """
    low, high = np.array(list(NUMBERS.values())).T
    share = (np.clip(genomes, -GENE_MAX, GENE_MAX) + GENE_MAX) / (2 * GENE_MAX)
    return np.ascontiguousarray(np.moveaxis(low + share * (high - low), -1, 0))


@dataclass(frozen=True)
class Rule:
    """One rule, or a batch `(...)` of them; call it with readings and their changes.

    Attributes:
        numbers: `(13, ...)`, in the order of `NUMBERS`.
    """

    numbers: np.ndarray

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(..., 2)` for readings and their changes, `(..., 16)`.

        `rungs.kinematic.drivers.follow` has the same operations in the same order.
        """
        near, slow, creep, avoid, away, left, diagonal = self.numbers[:7]
        target, gain, damping, most, lost, search = self.numbers[7:]
        reading, change = np.split(observation, 2, axis=-1)
        ahead = np.minimum(
            reading[..., (AHEAD_RIGHT, AHEAD_LEFT)].min(axis=-1),
            reading[..., LEFT_DIAGONAL] + left,
        )
        forward = np.minimum(np.maximum((ahead - near) / slow, creep), 1.0)
        side, grown = (
            diagonal * each[..., DIAGONAL] + (1.0 - diagonal) * each[..., SIDE]
            for each in (reading, change)
        )
        turn = gain * (side - target) + damping * grown
        turn = np.minimum(np.maximum(turn, -most), most)
        turn = np.where(side < lost, turn, search)
        return np.stack([forward, np.where(ahead < avoid, -away, turn)], axis=-1)

    def __getitem__(self, index: Any) -> Self:
        """The rules at `index` of the batch, in numpy's sense."""
        return type(self)(self.numbers[:, index])
