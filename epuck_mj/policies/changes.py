"""Policies that see how their readings change: one control step of memory."""

from dataclasses import asdict
from typing import Any, Self

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.policies.network import Controller, OneHiddenLayer
from epuck_mj.step.control import BatchPolicy


class WithChanges:
    """A batch policy whose members also see the change of each reading.

    Attributes:
        reflex: what acts on observations and their changes, `(..., 16)`.
    """

    def __init__(
        self, reflex: BatchPolicy, alike: bool = False, last: np.ndarray | None = None
    ):
        """Store who acts.

        Args:
            reflex: what acts on observations and their changes, `(..., 16)`.
            alike: whether it is one for any number of robots.
            last: observation of the last control step `(..., 8)`; None at a start.
        """
        self.reflex, self._alike, self._last = reflex, alike, last

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(..., 2)` for observations `(..., 8)`, which are remembered."""
        last = observation if self._last is None else self._last
        # whoever gave it may use its memory again
        self._last = observation.copy()
        return self.reflex(np.concatenate([observation, observation - last], axis=-1))

    def activation(self, observations: np.ndarray) -> np.ndarray:
        """Outputs of hidden neurons in a trial, `(T, hidden)`; `(T, 0)` without any.

        Args:
            observations: of its control steps, from the start on, `(T, 8)`.
        """
        if not isinstance(self.reflex, Controller):
            return np.zeros((len(observations), 0))
        changes = np.diff(observations, axis=0, prepend=observations[:1])
        return self.reflex.activation(np.concatenate([observations, changes], axis=-1))

    def __getitem__(self, index: Any) -> Self:
        """The members that a mask `(n,)` or a slice selects."""
        reflex = self.reflex if self._alike else self.reflex[index]
        last = None if self._last is None else self._last[index]
        return type(self)(reflex, self._alike, last)

    def started(self, n: int | None) -> Self:
        """See `control.Remembering`: at a start, nothing has changed."""
        return type(self)(self.reflex, self._alike)


class NetworkWithChanges(OneHiddenLayer):
    """A network that sees readings and their changes; a topology.

    Of the incoming weights of a hidden neuron, those of the eight readings come before
    those of their changes.
    """

    inputs = 2 * N_PROXIMITY

    def to_dict(self) -> dict[str, Any]:
        """The topology as written in controller files."""
        return {"changes": True, **asdict(self)}

    def decode(self, genomes: np.ndarray) -> WithChanges:
        """The controllers of genomes `(..., genes)`; see `controllers`.

        Raises:
            ValueError: if the genomes have another length.
        """
        return WithChanges(self.controllers(genomes), alike=np.ndim(genomes) == 1)
