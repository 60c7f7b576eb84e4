"""The paper's network: sensors in, one hidden layer, speed and turn out.

Sums are written out term by term instead of as a matrix product: BLAS orders a sum
by the size of the batch, and a controller must act the same alone and in a batch.
"""

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.host.limits import check
from epuck_mj.step.elementary import half_tanh

N_ACTIONS = 2


def genomes_of(genomes: np.ndarray, n_genes: int, network: str) -> np.ndarray:
    """Genomes `(..., n_genes)` as floats.

    Args:
        genomes: `(..., genes)`.
        n_genes: number of genes that the network has.
        network: its name in the message.

    Raises:
        ValueError: if the genomes have another length.
    """
    genomes = np.asarray(genomes, float)
    if genomes.shape[-1] != n_genes:
        raise ValueError(
            f"expected genomes of {n_genes} genes for {network}, "
            f"got {genomes.shape[-1]}"
        )
    return genomes


@dataclass(frozen=True)
class OneHiddenLayer:
    """Shape of a network with one hidden layer; a base of topologies.

    Attributes:
        hidden: number of hidden neurons.
        biases: whether hidden and output neurons have a bias weight.
        inputs: number of inputs, of all networks of a class.
    """

    hidden: int = 4
    biases: bool = False
    inputs: ClassVar[int]

    def __post_init__(self) -> None:
        """Refuse an invalid number of hidden neurons or invalid biases.

        Raises:
            ValueError: if either is invalid.
        """
        check("hidden", self.hidden)
        if type(self.biases) is not bool:
            raise ValueError(f"biases: expected true or false, got {self.biases!r}")

    @property
    def n_genes(self) -> int:
        """Number of weights: 40 for the paper's 8-4-2 without biases."""
        bias = int(self.biases)
        return (self.inputs + bias) * self.hidden + (self.hidden + bias) * N_ACTIONS

    def controllers(self, genomes: np.ndarray) -> "Controller":
        """The controllers of genomes `(..., genes)`, from all inputs to actions.

        A genome lists the hidden neurons one after the other, each with its incoming
        weights (and its bias last), then the output neurons likewise.

        Raises:
            ValueError: if the genomes have another length.
        """
        genomes = genomes_of(genomes, self.n_genes, str(self))
        n_in = self.inputs + self.biases
        batch = genomes.shape[:-1]
        hidden, output = np.split(genomes, [n_in * self.hidden], axis=-1)
        hidden = hidden.reshape(*batch, self.hidden, n_in)
        output = output.reshape(*batch, N_ACTIONS, self.hidden + self.biases)
        return Controller(
            np.ascontiguousarray(np.moveaxis(hidden, -1, 0)),
            np.ascontiguousarray(np.moveaxis(output, -1, 0)),
        )


class Network(OneHiddenLayer):
    """The paper's network, whose inputs are the eight readings; a topology."""

    inputs = N_PROXIMITY

    def to_dict(self) -> dict[str, Any]:
        """The topology as written in controller files."""
        return asdict(self)

    def decode(self, genomes: np.ndarray) -> "Controller":
        """See `controllers`."""
        return self.controllers(genomes)


@dataclass(frozen=True)
class Controller:
    """One controller, or a batch `(...)` of them; call it with observations.

    Attributes:
        hidden: weights `(inputs, ..., hidden)`; one row more than the observation
            has values is a bias.
        output: weights `(hidden, ..., 2)`, likewise.
    """

    hidden: np.ndarray
    output: np.ndarray

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(..., 2)` for observations `(..., 8)`: v in [0, 1], w in [-1, 1].

        Source: paper, section 4. w is 2 sigmoid - 1, so that 0 drives straight on.
        """
        return squashed(self.sums(observation))

    def sums(self, observation: np.ndarray) -> np.ndarray:
        """Weighted sums of the output neurons `(..., 2)`, of which actions are made."""
        return _layer(self.activation(observation), self.output)

    def activation(self, observation: np.ndarray) -> np.ndarray:
        """Output of the hidden neurons, `(..., hidden)` in [0, 1]."""
        hidden = half_tanh(_layer(observation, self.hidden))
        hidden += 1.0
        hidden *= 0.5
        return hidden

    def __getitem__(self, index: Any) -> "Controller":
        """The controllers at `index` of the batch, in numpy's sense."""
        return Controller(self.hidden[:, index], self.output[:, index])


def squashed(sums: np.ndarray) -> np.ndarray:
    """Actions `(..., 2)`: v in [0, 1], w in [-1, 1], of the output neurons' sums."""
    action = half_tanh(sums)
    action[..., 0] += 1.0
    action[..., 0] *= 0.5
    return action


def _layer(inputs: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted sums `(..., neurons)` of inputs `(..., n)`, added in their order."""
    total = inputs[..., 0, None] * weights[0]
    for i in range(1, inputs.shape[-1]):
        total += inputs[..., i, None] * weights[i]
    if len(weights) > inputs.shape[-1]:
        total += weights[-1]
    return total
