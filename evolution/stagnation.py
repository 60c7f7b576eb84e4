"""Whether a search has stopped making progress under a noise that never ends.

Criteria about the range of fitness or the size of steps do not see it: noise keeps both
wide. Medians over many generations do.

Source:
    N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, appendix B.3,
    Stagnation.
"""

import numpy as np


def stagnation_window(generations: int, genes: int, population: int) -> int:
    """How many of its last generations a start is judged by: a fifth, at least 120.

    Args:
        generations: how many there were since the start.
        genes: of a genome.
        population: individuals of a generation.
    """
    at_least = 120 + 30 * genes / population
    return int(np.clip(0.2 * generations, at_least, 20000))


def has_stagnated(history: np.ndarray, window: int) -> bool:
    """Whether fitness has not risen in the last `window` generations.

    Of none of the columns the median of the last 30 % is above that of the first 30 %.
    While there are fewer generations than that, there is no saying: False.

    Args:
        history: fitness `(generations, columns)` without NaN.
        window: at least 4.
    """
    if len(history) < window:
        return False
    part = int(0.3 * window)
    # the upper median: infinities have no mean
    first, last = (
        np.sort(values, axis=0)[part // 2]
        for values in (history[-window:][:part], history[-part:])
    )
    return bool(np.all(last <= first))
