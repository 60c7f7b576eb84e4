"""What genomes decode to: the paper's network, others that are shipped, or a user's.

A user's network is a class without arguments, `my.py:Name`, with

    n_genes: int                    number of weights
    n_state: int                    numbers remembered from step to step; 0 is a reflex
    act(genomes, observation, state) -> (action, state)

where genomes are `(..., n_genes)`, observations `(..., 8)`, states `(..., n_state)`, 0
at a start, and actions `(..., 2)`: v in [0, 1], w in [-1, 1]. A robot has to act the
same alone and among others, so sums are to be written out: a matrix product adds in an
order that depends on how many robots there are.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.host.limits import check
from epuck_mj.host.own_parts import failure, own_part
from epuck_mj.policies.changes import NetworkWithChanges
from epuck_mj.policies.follower import Follower
from epuck_mj.policies.network import N_ACTIONS, Network, genomes_of
from epuck_mj.step.control import BatchPolicy


class Topology(Protocol):
    """What genomes decode to."""

    @property
    def n_genes(self) -> int:
        """Number of weights."""
        ...

    def decode(self, genomes: np.ndarray) -> BatchPolicy:
        """The controllers of genomes `(..., genes)`."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """The topology as controller files say it; `topology_from` reads it."""
        ...


@dataclass(frozen=True)
class OwnNetwork:
    """A network of a user's.

    Attributes:
        name: of its class, `my.py:Name`.
    """

    name: str

    @cached_property
    def network(self) -> Any:
        """The user's object.

        Raises:
            UserError: if there is none, or it is not as this module says.
        """
        kind = own_part(self.name).value
        try:
            network = kind()
        except Exception as error:
            raise UserError(f"network '{self.name}' {failure(error)}") from None
        if not callable(getattr(network, "act", None)):
            raise UserError(f"network '{self.name}': expected a method 'act'")
        try:
            for key in ("n_genes", "n_state"):
                check(key, getattr(network, key, None))
        except ValueError as error:
            raise UserError(f"network '{self.name}': {error}") from None
        return network

    @property
    def n_genes(self) -> int:
        """Number of weights."""
        return self.network.n_genes

    def decode(self, genomes: np.ndarray) -> "OwnController":
        """The controllers of genomes `(..., genes)`, which remember nothing yet.

        Raises:
            ValueError: if the genomes have another length.
        """
        genomes = genomes_of(genomes, self.n_genes, f"'{self.name}'")
        state = np.zeros((*genomes.shape[:-1], self.network.n_state))
        return OwnController(self, genomes, state)

    def to_dict(self) -> dict[str, Any]:
        """See `Topology`."""
        return {"own": self.name}


class OwnController:
    """Controllers `(...)` of a user's network, and what they remember."""

    def __init__(self, own: OwnNetwork, genomes: np.ndarray, state: np.ndarray):
        """Put weights `(..., genes)` and memories `(..., n_state)` into a network."""
        self._own = own
        self._genomes = genomes
        self._state = state

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(..., 2)` for observations `(..., 8)`; memories go on.

        Raises:
            UserError: if the user's code fails, or gives no actions.
        """
        name, n_state = self._own.name, self._own.network.n_state
        robots = observation.shape[:-1]
        try:
            action, state = self._own.network.act(
                self._genomes, observation, self._state
            )
            action, state = np.asarray(action, float), np.asarray(state, float)
        except Exception as error:
            raise UserError(f"network '{name}' {failure(error)}") from None
        if action.shape != (*robots, N_ACTIONS):
            raise UserError(
                f"network '{name}': expected actions of shape {(*robots, N_ACTIONS)}, "
                f"got {action.shape}"
            )
        if state.shape != (*robots, n_state):
            raise UserError(
                f"network '{name}': expected a state of shape {(*robots, n_state)}, "
                f"got {state.shape}"
            )
        v, w = action[..., 0], action[..., 1]
        if not ((v >= 0) & (v <= 1) & (np.abs(w) <= 1)).all():
            raise UserError(
                f"network '{name}': expected v from 0 to 1 and w from -1 to 1, got v "
                f"{v.min():g} to {v.max():g} and w {w.min():g} to {w.max():g}"
            )
        self._state = state
        return action

    def __getitem__(self, index: Any) -> Self:
        """The controllers at `index` of the batch, in numpy's sense."""
        return type(self)(self._own, self._genomes[index], self._state[index])

    def started(self, n: int | None) -> Self:
        """See `control.Remembering`; one controller may drive any number of robots."""
        robots = () if n is None else (n,)
        genes, n_state = self._genomes.shape[-1], self._own.network.n_state
        genomes = np.broadcast_to(self._genomes, (*robots, genes))
        return type(self)(self._own, genomes, np.zeros((*robots, n_state)))


FEEDFORWARD = "feedforward"
"""Name of the paper's network."""

NETWORKS: Mapping[str, Callable[[int, bool], Topology]] = {
    FEEDFORWARD: Network,
    "feedforward_changes": NetworkWithChanges,
    "follower": lambda hidden, biases: Follower(),
}
"""Makers of shipped topologies by name, from hidden neurons and biases."""


def topology_from(fields: Mapping[str, Any]) -> Topology:
    """The topology that `to_dict` described; a user's code is not loaded yet.

    Raises:
        ValueError: if it is none.
        TypeError: if it is none.
    """
    if "own" in fields:
        if not isinstance(fields["own"], str) or len(fields) > 1:
            raise ValueError(f"expected the name of a network, got {fields['own']!r}")
        return OwnNetwork(fields["own"])
    if "follower" in fields:
        if fields != Follower().to_dict():
            raise ValueError(
                "expected the numbers of a follower and their ranges as in this version"
            )
        return Follower()
    if fields.get("changes") is True:
        rest = {key: value for key, value in fields.items() if key != "changes"}
        return NetworkWithChanges(**rest)
    return Network(**fields)


def check_network(name: str) -> None:
    """Refuse a user's network if a robot acts differently alone and among others.

    Args:
        name: as `my.py:Name`.

    Raises:
        UserError: for such a network, or one that gives no actions.
    """
    own, rng = OwnNetwork(name), np.random.default_rng(0)
    genomes = rng.uniform(-5, 5, (37, own.n_genes))
    crowd = own.decode(genomes)
    some = own.decode(genomes)[::3]
    alone = [own.decode(genome).started(None) for genome in genomes[::3]]
    for _ in range(5):
        observation = rng.random((37, N_PROXIMITY))
        action = crowd(observation)[::3]
        few = some(observation[::3])
        each = zip(alone, observation[::3], strict=True)
        one = [policy(seen) for policy, seen in each]
        if not (np.array_equal(action, few) and np.array_equal(action, one)):
            raise UserError(
                f"network '{name}': a robot acts differently alone and among others; "
                "expected sums that are written out instead of matrix products"
            )
