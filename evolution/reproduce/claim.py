"""A claim of the paper, and how claims are made of samples of runs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evolution.pages.words import PAPERS, median_and_quartiles
from evolution.reproduce.verdicts import NOT_MEASURED
from evolution.study.data import StudyData


@dataclass(frozen=True)
class Claim:
    """One claim with our number and the verdict.

    Attributes:
        text: what the paper says.
        ours: what we found, with interval.
        n: runs that it is based on.
        verdict: consistent, inconsistent, undecided, or can't be tested and why not.
    """

    text: str
    ours: str
    n: str
    verdict: str


def samples_of(
    study: StudyData, value: Callable[[str], np.ndarray]
) -> dict[str, np.ndarray]:
    """Samples of the paper's algorithms, empty where the study has no runs."""
    return {
        name: value(name) if study.runs.get(name) else np.zeros(0) for name in PAPERS
    }


def claim_of(
    text: str,
    sample: np.ndarray,
    judged: Callable[[], tuple[str, str]],
    quantity: str = "",
) -> Claim:
    """A claim about one algorithm, with what we found and the verdict.

    Args:
        text: what the paper says.
        sample: of the runs that say, `(n,)`, in percent if it has a quantity.
        judged: what we found and the verdict, if there are runs.
        quantity: what the sample is.
    """
    if not sample.size:
        return Claim(text, "-", "0", NOT_MEASURED)
    ours, verdict = judged()
    if quantity:
        ours = f"{quantity}: {median_and_quartiles(sample, ' %')}; so in {ours}"
    else:
        ours = f"{median_and_quartiles(sample)}; {ours}"
    return Claim(text, ours, str(sample.size), verdict)
