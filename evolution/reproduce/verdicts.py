"""Verdicts on claims: what runs have to show for or against a claim.

As in the report, there is no verdict with fewer than 10 runs of an algorithm. An order
needs a Mann-Whitney p below 0.05, adjusted for the pairs of its kind. A statement about
every run needs a Wilson interval on one side of one half. The best of the paper's few
runs needs a rank among ours that is not too extreme.
"""

from math import floor

import numpy as np

from evolution.pages.words import probability
from evolution.report.sections.comparisons import Comparison
from evolution.statistics.best_of_few import chance_of_best
from evolution.statistics.estimates import wilson
from evolution.statistics.significance import FEWEST_FOR_STARS, LEVELS

CONSISTENT, INCONSISTENT = "consistent", "inconsistent"
NOT_CONTRADICTED = "consistent, in that nothing contradicts it"
UNDECIDED = "undecided by these runs"
TOO_FEW = f"can't be tested: fewer than {FEWEST_FOR_STARS} runs"
NOT_MEASURED = "can't be tested: not measured"
OTHER_STUDY = "can't be tested: another study"


def of_order(pair: Comparison) -> str:
    """Verdict on whether the first experiment of a pair exceeds the second."""
    if not pair.enough:
        return TOO_FEW
    if not pair.decided:
        return UNDECIDED
    return CONSISTENT if pair.a12.value > 0.5 else INCONSISTENT


def of_most(holds: np.ndarray) -> tuple[str, str]:
    """In how many runs `(n,)` something holds, and the verdict on whether most."""
    share = wilson(int(holds.sum()), holds.size)
    ours = f"{holds.sum()} of {holds.size} runs [{share.low:.0%}, {share.high:.0%}]"
    if holds.size < FEWEST_FOR_STARS:
        return ours, TOO_FEW
    if share.low > 0.5:
        return ours, CONSISTENT
    return ours, INCONSISTENT if share.high < 0.5 else UNDECIDED


def of_best(sample: np.ndarray, best: float, replicates: int) -> tuple[str, str]:
    """The rank of the best of other runs among ours, and the verdict on it.

    At most, our runs do not contradict that it came from runs like ours. A best above
    all of ours may still be luck: with a probability of 3 / (n + 3), the best of three
    more runs like ours exceeds all `n`.

    Args:
        sample: of our runs, `(n,)`.
        best: of theirs.
        replicates: how many they had.
    """
    above, p = int((sample > best).sum()), chance_of_best(sample, best, replicates)
    ours = (
        f"runs from {sample.min():.1f} to {sample.max():.1f}, {above} of {sample.size} "
        f"above; the best of {replicates} runs like these has so extreme a rank with "
        f"p {probability(p)}"
    )
    if sample.size < FEWEST_FOR_STARS:
        return ours, TOO_FEW
    if p < LEVELS[0]:
        return ours, INCONSISTENT
    return ours, NOT_CONTRADICTED if above else UNDECIDED


def fewest_to_contradict(replicates: int) -> int:
    """Number of our runs below which no maximum can be too high."""
    # 2 replicates / (n + replicates) below the level
    return floor(2 * replicates / LEVELS[0] - replicates) + 1
