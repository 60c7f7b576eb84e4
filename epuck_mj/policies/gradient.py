"""Gradients of the paper's network by its weights.

Sums are written out along an axis that numpy adds in order: the same bits everywhere.
"""

import numpy as np

from epuck_mj.policies.network import Controller, Network


def gradient(
    network: Network,
    controllers: Controller,
    observation: np.ndarray,
    by_sums: np.ndarray,
) -> np.ndarray:
    """Gradients `(n, genes)` of something that depends on the output neurons' sums.

    Args:
        network: that the controllers are of.
        controllers: `(n,)` of them.
        observation: of each, in `m` control steps, `(n, m, 8)`.
        by_sums: derivative by the weighted sums of v and w then, `(n, m, 2)`.
    """
    n, m, _ = observation.shape
    each = in_all_steps(controllers)
    active = each.activation(observation)
    # (hidden, n, 1, 2) -> (n, 1, hidden, 2)
    weights = np.moveaxis(each.output[: network.hidden], 0, 2)
    back = (by_sums[:, :, None, :] * weights).sum(axis=-1)
    by_hidden_sums = back * active * (1.0 - active)
    inputs, neurons = observation, active
    if network.biases:
        ones = np.ones((n, m, 1))
        inputs = np.concatenate([observation, ones], axis=-1)
        neurons = np.concatenate([active, ones], axis=-1)
    # genomes list neuron after neuron, each with its incoming weights
    hidden = (by_hidden_sums[..., None] * inputs[:, :, None, :]).sum(axis=1)
    output = (by_sums[..., None] * neurons[:, :, None, :]).sum(axis=1)
    return np.concatenate([hidden.reshape(n, -1), output.reshape(n, -1)], axis=1)


def in_all_steps(controllers: Controller) -> Controller:
    """Controllers `(n, 1)`, which act on observations `(n, m, 8)`."""
    return Controller(controllers.hidden[:, :, None], controllers.output[:, :, None])


def squashing_slope(action: np.ndarray) -> np.ndarray:
    """Derivative `(..., 2)` of actions `(..., 2)` by the sums they are made of."""
    v, w = action[..., 0], action[..., 1]
    return np.stack([v * (1.0 - v), (1.0 - w * w) / 2.0], axis=-1)
