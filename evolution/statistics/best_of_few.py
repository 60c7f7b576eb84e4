"""The best of a few runs: how extreme it is among others, and how often it leads."""

from collections.abc import Sequence
from math import comb

import numpy as np


def chance_of_best(sample: np.ndarray, best: float, replicates: int) -> float:
    """Two-sided probability that the best of other runs ranks as extreme among ours.

    If all runs are alike, theirs and ours are in any order with the same probability.
    """
    above, n = int((sample > best).sum()), sample.size

    def at_least(k: int) -> float:
        """Probability that `k` or more of our runs exceed all other runs."""
        return comb(n + replicates - k, replicates) / comb(n + replicates, replicates)

    at_most = 1 - at_least(above + 1) if above < n else 1.0
    return min(1.0, 2 * min(at_least(above), at_most))


def chance_of_order(samples: Sequence[np.ndarray], replicates: int) -> float:
    """Probability that the best of some runs of each sample have the samples' order.

    Runs are drawn with replacement from samples `(n,)`; equal bests have no order.

    Args:
        samples: of three experiments, the one that shall have the highest best first.
        replicates: runs drawn of each.
    """
    first, second, third = (np.sort(sample) for sample in samples)
    ranks = np.arange(second.size + 1) / second.size
    # the distribution of the best of the second's draws over its values
    best = np.diff(ranks**replicates)
    above = np.searchsorted(first, second, side="right") / first.size
    below = np.searchsorted(third, second, side="left") / third.size
    return float((best * (1 - above**replicates) * below**replicates).sum())
