"""The network that PPO trains, as one of a user's own: `benchmarks.ppo.network:Tanh`.

Two hidden layers of 64 neurons with tanh, and an action that is cut to its bounds: the
mean of stable-baselines3's default policy. It can be evaluated and replayed as what
evolution finds; see `docs/extending.md`.
"""

from itertools import pairwise

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.policies.network import N_ACTIONS
from epuck_mj.step.elementary import half_tanh

HIDDEN = (64, 64)
LAYERS = list(pairwise((N_PROXIMITY, *HIDDEN, N_ACTIONS)))
"""Inputs and outputs of each layer."""


class Tanh:
    """Weights `(inputs, outputs)` and biases of one layer after the other."""

    n_genes = sum((n_in + 1) * n_out for n_in, n_out in LAYERS)
    n_state = 0

    def act(self, genomes, observation, state):
        """Actions `(..., 2)` of weights `(..., genes)` for observations `(..., 8)`."""
        values, place = observation, 0
        for i, (n_in, n_out) in enumerate(LAYERS):
            size = (n_in + 1) * n_out
            layer = genomes[..., place : place + size]
            layer = layer.reshape(*layer.shape[:-1], n_in + 1, n_out)
            place += size
            # the biases are the last row
            total = layer[..., n_in, :] + values[..., :1] * layer[..., 0, :]
            for k in range(1, n_in):
                total = total + values[..., k : k + 1] * layer[..., k, :]
            # tanh with the same bits on every processor
            values = half_tanh(2 * total) if i < len(HIDDEN) else total
        return np.clip(values, (0.0, -1.0), (1.0, 1.0)), state


def genome_of(layers: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Genome `(genes,)` of the weights `(outputs, inputs)` and biases of all layers."""
    rows = [np.concatenate([weight.T, bias[None]]).ravel() for weight, bias in layers]
    return np.concatenate(rows).astype(float)
