"""The paper's network: sensors in, one hidden layer, speed and turn out.

Sums are written out term by term instead of as a matrix product: BLAS orders a sum
by the size of the batch, and a controller must act the same alone and in a batch.
"""

from dataclasses import asdict, dataclass
from typing import Any

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
class Network:
    """Shape of the network.

    Attributes:
        hidden: number of hidden neurons.
        biases: whether hidden and output neurons have a bias weight.
    """

    hidden: int = 4
    biases: bool = False

    def __post_init__(self) -> None:
        """Refuse an invalid number of hidden neurons or invalid biases.

        Raises:
            ValueError: if either is invalid.
        """
        check("hidden", self.hidden)
        if type(self.biases) is not bool:
            raise ValueError(f"biases: expected true or false, got {self.biases!r}")

    def to_dict(self) -> dict[str, Any]:
        """The topology as written in controller files."""
        return asdict(self)

    @property
    def n_genes(self) -> int:
        """Number of weights: 40 for the paper's 8-4-2 without biases."""
        return n_weights(N_PROXIMITY, self.hidden, self.biases)

    def decode(self, genomes: np.ndarray) -> "Controller":
        """The controllers of genomes `(..., genes)`.

        A genome lists the hidden neurons one after the other, each with its incoming
        weights (and its bias last), then the output neurons likewise.

        Raises:
            ValueError: if the genomes have another length.
        """
        genomes = genomes_of(genomes, self.n_genes, str(self))
        return controllers_of(genomes, N_PROXIMITY, self.hidden, self.biases)


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


def n_weights(inputs: int, hidden: int, biases: bool) -> int:
    """Number of weights of a network with so many inputs and hidden neurons."""
    return (inputs + biases) * hidden + (hidden + biases) * N_ACTIONS


def controllers_of(
    genomes: np.ndarray, inputs: int, hidden: int, biases: bool
) -> Controller:
    """The controllers of genomes `(..., genes)`; see `Network.decode`."""
    n_in, batch = inputs + biases, genomes.shape[:-1]
    into, out = np.split(genomes, [n_in * hidden], axis=-1)
    into = into.reshape(*batch, hidden, n_in)
    out = out.reshape(*batch, N_ACTIONS, hidden + biases)
    return Controller(
        np.ascontiguousarray(np.moveaxis(into, -1, 0)),
        np.ascontiguousarray(np.moveaxis(out, -1, 0)),
    )


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
