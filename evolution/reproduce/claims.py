"""The paper's claims tested on a study: our number, its interval, n, a verdict."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.pages.words import LABELS, PAPERS, median_and_quartiles
from evolution.report.measures import held_out_measure, measures
from evolution.report.samples import FOLLOWED, known
from evolution.report.sections.comparisons import Comparison, comparisons_of, numbers
from evolution.reproduce.verdicts import (
    HANGS_ON_READING,
    NOT_MEASURED,
    OTHER_STUDY,
    TOO_FEW,
    of_best,
    of_most,
    of_order,
)
from evolution.settings.comparison import differences
from evolution.settings.config import ExperimentConfig
from evolution.study.config import StudyConfig, find_study
from evolution.study.data import StudyData

PAPER = "paper"
"""The shipped study whose experiments are the paper's."""

PAPER_BEST = {"de-best": 246.66, "de-rand": 215.217, "ga": 202.775}
"""Maximum fitness of each algorithm. Source: the paper, section 5."""

REPLICATES = 3
"""Number of runs of which the paper reports the best.

The paper says "at least three". Of more runs, a low best would be even rarer.
"""

NEAR = 2 / 3
"""Share of the best above which a mean approaches it: our reading."""

MATURE = 0.9
"""Share of its final best at which a run has mature individuals: our reading."""

EARLY = (0.5, 1 / 3)
"""Shares of the budget that are early: our readings, a lenient and a strict one."""


@dataclass(frozen=True)
class Claim:
    """One claim with our number and the verdict.

    Attributes:
        text: what the paper says.
        ours: what we found, with interval.
        n: runs that it is based on.
        verdict: consistent, inconsistent or can't be tested, and why not.
    """

    text: str
    ours: str
    n: str
    verdict: str


def claims(study: StudyData) -> list[Claim]:
    """Test all claims of the paper on a study."""
    stored = _samples(study, study.best_stored)
    shares = _samples(study, lambda name: 100 * mean_to_best(study, name))
    where = "in the mean's share of the best [%]"
    in_shares = _orders(_pairs(study, shares), shares, where)
    early = _samples(study, lambda name: 100 * maturity(study, name))
    found = [
        *_orders(_pairs(study, stored), stored, "in best (stored) fitness"),
        *(_maximum(stored, name) for name in PAPER_BEST),
        *(_approaches(shares, name) for name in ("de-best", "de-rand")),
        _stays_apart(shares),
        *in_shares[1:],
        *(_mature_early(early, name) for name in ("de-best", "de-rand")),
        *(_follows(study, name) for name in PAPERS),
    ]
    return _of_the_paper(study, found)


def held_out_order(study: StudyData, robot: str) -> list[Claim]:
    """Test the paper's order of algorithms on held-out fitness, as the report does.

    There p values are adjusted for all pairs of the study, baselines included.
    """
    held_out = _samples(study, lambda name: study.held_out(name, robot))
    measure = held_out_measure(robot)
    rows = comparisons_of(measures(study)[measure], study.alike)
    found = _orders(rows, held_out, f"in held-out fitness on {robot}")
    return _of_the_paper(study, found)


@cache
def papers_experiments() -> Mapping[str, ExperimentConfig]:
    """The shipped experiments of the paper's study."""
    return StudyConfig.load(find_study(PAPER)).experiments


def unlike(study: StudyData) -> list[str]:
    """Differences of experiments from the paper's except robots, a line each."""
    shipped, lines = papers_experiments(), []
    for name in PAPERS:
        if name not in study.configs:
            continue
        found = differences(
            {"shipped": shipped[name], "ours": study.configs[name]}, ("seed", "robot")
        )
        differing = [
            f"{key} {values.get('ours')} (shipped {values.get('shipped')})"
            for key, values in found.items()
        ]
        if differing:
            lines.append(f"{name}: {', '.join(differing)}")
    return lines


def mean_to_best(study: StudyData, name: str) -> np.ndarray:
    """Final population mean as a share of the population's best, `(runs,)`."""
    histories = [run.history for run in study.runs[name]]
    return np.array([h["mean"][-1] / max(h["best"][-1], 1e-12) for h in histories])


def maturity(study: StudyData, name: str) -> np.ndarray:
    """Share of its evaluations after which a run has 90 % of its best, `(runs,)`."""
    shares = []
    for run in study.runs[name]:
        best = np.maximum.accumulate(run.history["best"])
        first = (best >= MATURE * best[-1]).argmax()
        spent = run.history["evaluations"]
        shares.append(spent[first] / spent[-1])
    return np.array(shares)


def tally(found: Sequence[Claim]) -> dict[str, int]:
    """Number of claims by verdict, the most frequent first."""
    return dict(Counter(claim.verdict for claim in found).most_common())


def _samples(
    study: StudyData, value: Callable[[str], np.ndarray]
) -> dict[str, np.ndarray]:
    """Samples of the paper's algorithms, empty where the study has no runs."""
    return {
        name: value(name) if study.runs.get(name) else np.zeros(0) for name in PAPERS
    }


def _of_the_paper(study: StudyData, found: Sequence[Claim]) -> list[Claim]:
    """The claims, untested if the experiments differ from the paper's."""
    if not unlike(study):
        return list(found)
    return [Claim(each.text, "-", each.n, OTHER_STUDY) for each in found]


def _pairs(study: StudyData, samples: dict[str, np.ndarray]) -> list[Comparison]:
    """All pairs of the paper's algorithms that have runs."""
    filled = {name: sample for name, sample in samples.items() if sample.size}
    return comparisons_of(filled, study.alike)


def _orders(
    rows: Sequence[Comparison], samples: dict[str, np.ndarray], where: str
) -> list[Claim]:
    """Claims that DE/best exceeds DE/rand and the GA, and DE/rand the GA."""
    by_pair, found = {(row.a, row.b): row for row in rows}, []
    for pair in (("de-best", "de-rand"), ("de-best", "ga"), ("de-rand", "ga")):
        better, worse = pair
        text = f"{LABELS[better]} exceeds {LABELS[worse]} {where}"
        n = f"{samples[better].size} and {samples[worse].size}"
        row = by_pair.get(pair)
        if row is None:
            found.append(Claim(text, "-", n, TOO_FEW))
        else:
            found.append(Claim(text, numbers(row), n, of_order(row)))
    return found


def _maximum(stored: dict[str, np.ndarray], name: str) -> Claim:
    """Claim that an algorithm reaches the paper's maximum."""
    sample, paper = stored[name], PAPER_BEST[name]
    text = f"{LABELS[name]} reaches a maximum fitness of {paper}"
    return _claim(text, sample, lambda: of_best(sample, paper, REPLICATES))


def _approaches(shares: dict[str, np.ndarray], name: str) -> Claim:
    text = f"{LABELS[name]}'s mean approaches its best (read as: above two thirds)"
    sample = shares[name]
    return _claim(text, sample, lambda: of_most(sample > 100 * NEAR), "final share")


def _stays_apart(shares: dict[str, np.ndarray]) -> Claim:
    text = "GA's mean stays far from its best (read as: below two thirds)"
    sample = shares["ga"]
    return _claim(text, sample, lambda: of_most(sample < 100 * NEAR), "final share")


def _mature_early(early: dict[str, np.ndarray], name: str) -> Claim:
    lenient, strict = EARLY
    text = (
        f"{LABELS[name]} has mature individuals early (read as: {MATURE:.0%} of its "
        f"final best within {lenient:.0%}, and within {strict:.0%}, of the budget)"
    )
    sample = early[name]

    def judged() -> tuple[str, str]:
        ours, verdict = of_most(sample <= 100 * lenient)
        ours_strictly, strictly = of_most(sample <= 100 * strict)
        found = f"{ours}, and in {ours_strictly}"
        return found, verdict if verdict == strictly else HANGS_ON_READING

    return _claim(text, sample, judged, "share spent")


def _follows(study: StudyData, name: str) -> Claim:
    """Claim that champions find and follow walls on wheels without crashing."""
    text = (
        f"{LABELS[name]}'s champion finds a wall and follows it without crashing "
        f"(read as: {FOLLOWED:.0%} of its trials on {WHEELED_ROBOT} are a wall "
        "follower's or a hugger's)"
    )
    runs = study.runs.get(name, ())
    tests = [run.scores.held_out[WHEELED_ROBOT] for run in runs]
    sample = 100 * known([test.following for test in tests])
    return _claim(
        text, sample, lambda: of_most(sample >= 100 * FOLLOWED), "share of trials"
    )


def _claim(
    text: str,
    sample: np.ndarray,
    judged: Callable[[], tuple[str, str]],
    quantity: str = "",
) -> Claim:
    """Make a claim about one algorithm.

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
