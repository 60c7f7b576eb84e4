"""The paper's claims tested on a study: our number, its interval, n, a verdict."""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.pages.words import (
    LABELS,
    PAPER_BEST,
    PAPERS,
    REPLICATES,
)
from evolution.report.samples import FOLLOWED, known
from evolution.report.sections.comparisons import (
    EQUIVALENCE_MARGIN,
    Comparison,
    comparisons_of,
    numbers,
)
from evolution.reproduce.claim import Claim, claim_of, samples_of
from evolution.reproduce.maturity import (
    mature_by_fixed_measures,
    mature_by_own_end,
    maturity,
)
from evolution.reproduce.verdicts import (
    INCONSISTENT,
    NOT_CONTRADICTED,
    NOT_MEASURED,
    OTHER_STUDY,
    TOO_FEW,
    of_best,
    of_most,
    of_order,
)
from evolution.settings.comparison import differences
from evolution.settings.config import ExperimentConfig
from evolution.statistics.best_of_few import chance_of_order
from evolution.statistics.significance import (
    FEWEST_FOR_STARS,
    LEVELS,
)
from evolution.study.config import StudyConfig, find_study
from evolution.study.data import StudyData

PAPER = "paper"
"""The shipped study whose experiments are the paper's."""

NEAR_READINGS = (
    ("lenient", 2 / 3, "two thirds"),
    ("strict", 0.9, "nine tenths"),
)
"""Shares of the best above which a mean approaches it: our readings."""


def claims(study: StudyData) -> list[Claim]:
    """Test all claims of the paper on a study."""
    stored = samples_of(study, study.best_stored)
    shares = samples_of(study, lambda name: 100 * mean_to_best(study, name))
    where = "in the mean's share of the best [%]"
    in_shares = _orders(_pairs(study, shares, 100 * EQUIVALENCE_MARGIN), shares, where)
    early = samples_of(study, lambda name: 100 * maturity(study, name))
    found = [
        *_orders(
            _pairs(study, stored, EQUIVALENCE_MARGIN * study.steps),
            stored,
            "in best (stored) fitness",
        ),
        *(_maximum(stored, name) for name in PAPER_BEST),
        *_together(stored),
        *(
            claim
            for name in ("de-best", "de-rand")
            for claim in _approaches(shares, name)
        ),
        *_stays_apart(shares),
        *in_shares[1:],
        *(mature_by_own_end(early, name) for name in ("de-best", "de-rand")),
        *mature_by_fixed_measures(study),
        *(
            _follows(study, name, strict=strict)
            for name in PAPERS
            for strict in (False, True)
        ),
    ]
    return _of_the_paper(study, found)


def held_out_pairs(study: StudyData, robot: str) -> list[Comparison]:
    """The paper's algorithms against each other in held-out fitness on a robot."""
    held_out = samples_of(study, lambda name: study.held_out(name, robot))
    return _pairs(study, held_out, EQUIVALENCE_MARGIN * study.steps)


def held_out_order(study: StudyData, robot: str) -> list[Claim]:
    """Test the paper's order of algorithms on held-out fitness, as the report does."""
    held_out = samples_of(study, lambda name: study.held_out(name, robot))
    rows = held_out_pairs(study, robot)
    found = _orders(rows, held_out, f"in held-out fitness on {robot}")
    return _of_the_paper(study, found)


@cache
def papers_experiments() -> Mapping[str, ExperimentConfig]:
    """The shipped experiments of the paper's study."""
    return StudyConfig.load(find_study(PAPER)).experiments


FREE = ("seed", "robot", "climb", "finalists", "validation_starts", "test_starts")
"""Keys in which a study may differ from the shipped one and still be of the paper.

They say where evolution runs and how a champion is chosen and tested.
"""


def unlike(study: StudyData) -> list[str]:
    """Differences of experiments from the paper's, without `FREE`, a line each."""
    shipped, lines = papers_experiments(), []
    for name in PAPERS:
        if name not in study.configs:
            continue
        found = differences(
            {"shipped": shipped[name], "ours": study.configs[name]}, FREE
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


def tally(found: Sequence[Claim]) -> dict[str, int]:
    """Number of claims by verdict, the most frequent first."""
    return dict(Counter(claim.verdict for claim in found).most_common())


def _of_the_paper(study: StudyData, found: Sequence[Claim]) -> list[Claim]:
    """The claims, untested if the experiments differ from the paper's."""
    if not unlike(study):
        return list(found)
    return [Claim(each.text, "-", each.n, OTHER_STUDY) for each in found]


def _pairs(
    study: StudyData, samples: dict[str, np.ndarray], margin: float
) -> list[Comparison]:
    """All pairs of the paper's algorithms that have runs."""
    filled = {name: sample for name, sample in samples.items() if sample.size}
    return comparisons_of(filled, study.alike, margin)


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
    return claim_of(text, sample, lambda: of_best(sample, paper, REPLICATES))


def _approaches(shares: dict[str, np.ndarray], name: str) -> list[Claim]:
    """Claims that a mean approaches its best, by the lenient and the strict reading."""
    return [
        claim_of(
            f"{LABELS[name]}'s mean approaches its best ({reading}: above {words})",
            shares[name],
            lambda least=least: of_most(shares[name] > 100 * least),
            "final share",
        )
        for reading, least, words in NEAR_READINGS
    ]


def _stays_apart(shares: dict[str, np.ndarray]) -> list[Claim]:
    """Claims that the GA's mean stays far from its best, by both readings."""
    return [
        claim_of(
            f"GA's mean stays far from its best (read as: below {words})",
            shares["ga"],
            lambda least=least: of_most(shares["ga"] < 100 * least),
            "final share",
        )
        for _, least, words in NEAR_READINGS
    ]


def _together(stored: dict[str, np.ndarray]) -> list[Claim]:
    """The paper's three best fitnesses tested together.

    Each difference alone may be luck. Together they show that our GA is not theirs.
    """
    names = " > ".join(LABELS[name] for name in PAPER_BEST)
    text = f"The best of {REPLICATES} runs each: {names}"
    if not all(stored[name].size for name in PAPER_BEST):
        return [Claim(text, "-", "0", NOT_MEASURED)]
    samples = [stored[name] for name in PAPER_BEST]
    p = chance_of_order(samples, REPLICATES)
    n = ", ".join(str(sample.size) for sample in samples)
    ours = f"the best of {REPLICATES} of our runs each have this order with p {p:.2g}"
    if min(sample.size for sample in samples) < FEWEST_FOR_STARS:
        verdict = TOO_FEW
    else:
        verdict = INCONSISTENT if p < LEVELS[0] else NOT_CONTRADICTED
    return [Claim(text, ours, n, verdict)]


def _follows(study: StudyData, name: str, *, strict: bool) -> Claim:
    """Claim that champions find and follow walls on wheels without crashing."""
    whose = "a wall follower's" if strict else "a wall follower's or a hugger's"
    reading = "strict" if strict else "lenient"
    text = (
        f"{LABELS[name]}'s champion finds a wall and follows it without crashing "
        f"({reading}: {FOLLOWED:.0%} of its trials on {WHEELED_ROBOT} are {whose})"
    )
    tests = [run.scores.held_out[WHEELED_ROBOT] for run in study.runs.get(name, ())]
    shares = [test.keeping if strict else test.following for test in tests]
    sample = 100 * known(shares)
    return claim_of(
        text, sample, lambda: of_most(sample >= 100 * FOLLOWED), "share of trials"
    )
