"""The paper's claims held against a study: our number, its interval, n, a verdict.

A claim is consistent or inconsistent only where the data say so. An order needs a
Mann-Whitney p below 0.05, a statement about every run a Wilson interval on one side of
one half, and a maximum enough runs that one of the paper's would hardly lie outside
theirs. All else cannot be tested, nor can anything at another budget than the paper's.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evolution.comparisons import a12_interval, mann_whitney
from evolution.report.words import probability
from evolution.results import WHEELED_ROBOT
from evolution.statistics import quartiles, wilson
from evolution.study_data import StudyData

CONSISTENT, INCONSISTENT, UNTESTED = "consistent", "inconsistent", "can't be tested"

LEVEL = 0.05
"""Of the test of an order; claims are not adjusted for their number."""

OUTSIDE_LEVEL = 0.1
"""Chance of a run of ours outside the range of the others at which a maximum that is
outside counts: 19 runs and more."""

TASK = {"evaluations": 30_000, "steps": 300, "fitness": "product"}
"""What the claims are about."""

FEWEST = 3
"""Runs of each algorithm below which nothing is tested: the paper's own number."""

PAPER_BEST = {"de-best": 246.66, "de-rand": 215.217, "ga": 202.775}
"""Maximum fitness of each algorithm. Source: the paper, section 5."""

DISPLAY = {"de-best": "DE/best/1/bin", "de-rand": "DE/rand/1/bin", "ga": "GA"}

MATURE = 0.9
"""Share of its final best at which a run has mature individuals: our reading."""

EARLY = 0.5
"""Share of the budget that is early: our reading, and a lenient one."""

FOLLOWING = 0.9
"""Least share of a champion's trials that follow a wall without crashing."""


@dataclass(frozen=True)
class Claim:
    """One claim and what became of it.

    Attributes:
        text: what the paper says.
        ours: what we found, with interval.
        n: runs that it is based on.
        verdict: consistent, inconsistent or can't be tested.
    """

    text: str
    ours: str
    n: str
    verdict: str


def claims(study: StudyData) -> list[Claim]:
    """All claims of the paper, held against a study."""
    unlike = _unlike(study)
    if unlike:
        study = replace(study, runs={})
    stored = _by_name(study, lambda name: best_stored(study, name))
    found = [
        _order(stored, better, worse, "in best (stored) fitness")
        for better, worse in (("de-best", "de-rand"), ("de-rand", "ga"))
    ]
    found.append(_order(stored, "de-best", "ga", "in best (stored) fitness"))
    found += [_maximum(stored, name) for name in PAPER_BEST]
    gap = _by_name(study, lambda name: mean_to_best(study, name))
    found += [_approaches(gap, name) for name in ("de-best", "de-rand")]
    found.append(_stays_apart(gap))
    early = _by_name(study, lambda name: maturity(study, name))
    found += [_mature_early(early, name) for name in ("de-best", "de-rand")]
    found += [_follows(study, name) for name in ("de-best", "de-rand", "ga")]
    return [replace(claim, ours=unlike) for claim in found] if unlike else found


def _unlike(study: StudyData) -> str:
    """What makes the paper's three other experiments than its own; empty if nothing."""
    for name, config in study.configs.items():
        for key, expected in TASK.items():
            if name in DISPLAY and (got := getattr(config, key)) != expected:
                return f"needs {key} {expected}, the study has {got}"
    return ""


def held_out_order(study: StudyData, robot: str) -> list[Claim]:
    """The paper's order in what the paper did not measure: held-out fitness."""
    held_out = _by_name(study, lambda name: study.held_out(name, robot))
    pairs = (("de-best", "de-rand"), ("de-rand", "ga"), ("de-best", "ga"))
    where = f"in held-out fitness on {robot}"
    return [_order(held_out, better, worse, where) for better, worse in pairs]


def best_stored(study: StudyData, name: str) -> np.ndarray:
    """Highest stored fitness that each run has seen, `(runs,)`: as in Figs. 3 to 5."""
    return np.array([run.history["best"].max() for run in study.runs[name]])


def mean_to_best(study: StudyData, name: str) -> np.ndarray:
    """Final population mean as a share of the population's best, `(runs,)`."""
    histories = [run.history for run in study.runs[name]]
    return np.array([h["mean"][-1] / max(h["best"][-1], 1e-12) for h in histories])


def maturity(study: StudyData, name: str) -> np.ndarray:
    """Share of the budget after which a run has 90 % of its final best, `(runs,)`."""
    shares = []
    for run in study.runs[name]:
        best = np.maximum.accumulate(run.history["best"])
        first = (best >= MATURE * best[-1]).argmax()
        spent = run.history["evaluations"]
        shares.append(spent[first] / spent[-1])
    return np.array(shares)


def _by_name(
    study: StudyData, value: Callable[[str], np.ndarray]
) -> dict[str, np.ndarray]:
    """A sample per algorithm of the paper; empty where the study has none."""
    return {
        name: value(name) if study.runs.get(name) else np.zeros(0) for name in DISPLAY
    }


def _order(
    samples: dict[str, np.ndarray], better: str, worse: str, where: str
) -> Claim:
    a, b = samples[better], samples[worse]
    text = f"{DISPLAY[better]} beats {DISPLAY[worse]} {where}"
    n = f"{a.size} and {b.size}"
    if min(a.size, b.size) < FEWEST:
        return _too_few(text, n)
    ours, verdict = _compared(a, b)
    return Claim(text, f"medians {_median(a)} and {_median(b)}; {ours}", n, verdict)


def _maximum(stored: dict[str, np.ndarray], name: str) -> Claim:
    """Whether the paper's maximum lies among those of our runs."""
    sample, paper = stored[name], PAPER_BEST[name]
    text = f"{DISPLAY[name]} reaches a maximum fitness of {paper}"
    if sample.size < FEWEST:
        return _too_few(text, str(sample.size))
    low, high, chance = sample.min(), sample.max(), 2 / (sample.size + 1)
    ours = (
        f"median {_median(sample)}, runs from {low:.1f} to {high:.1f}; another run "
        f"like these is outside with a chance of {chance:.2f}"
    )
    verdict = INCONSISTENT if chance <= OUTSIDE_LEVEL else UNTESTED
    if low <= paper <= high:
        verdict = CONSISTENT
    return Claim(text, ours, str(sample.size), verdict)


def _approaches(gap: dict[str, np.ndarray], name: str) -> Claim:
    """DE: the mean ends closer to the best than the GA's does."""
    text = f"{DISPLAY[name]}'s mean approaches its best, more than the GA's"
    a, b = gap[name], gap["ga"]
    n = f"{a.size} and {b.size}"
    if min(a.size, b.size) < FEWEST:
        return _too_few(text, n)
    ours, verdict = _compared(a, b)
    ours = f"final mean / best {_percent(a)}, GA {_percent(b)}; {ours}"
    return Claim(text, ours, n, verdict)


def _stays_apart(gap: dict[str, np.ndarray]) -> Claim:
    text = "the GA's mean stays far from its best (read as: below two thirds)"
    sample = gap["ga"]
    if sample.size < FEWEST:
        return _too_few(text, str(sample.size))
    ours, verdict = _mostly(sample < 2 / 3)
    ours = f"final mean / best {_percent(sample)}; so in {ours}"
    return Claim(text, ours, str(sample.size), verdict)


def _mature_early(early: dict[str, np.ndarray], name: str) -> Claim:
    text = (
        f"{DISPLAY[name]} has mature individuals early (read as: {MATURE:.0%} of its "
        f"final best within {EARLY:.0%} of the budget)"
    )
    sample = early[name]
    if sample.size < FEWEST:
        return _too_few(text, str(sample.size))
    ours, verdict = _mostly(sample <= EARLY)
    ours = f"after {_percent(sample)} of the budget; so in {ours}"
    return Claim(text, ours, str(sample.size), verdict)


def _follows(study: StudyData, name: str) -> Claim:
    """Finds a wall, follows it, does not crash: on wheels."""
    robot = WHEELED_ROBOT
    text = (
        f"{DISPLAY[name]}'s best finds a wall and follows it without crashing (read "
        f"as: in {FOLLOWING:.0%} of its trials on {robot})"
    )
    tests = [run.champion.scores["held_out"][robot] for run in study.runs.get(name, ())]
    shares = np.array([following_share(test) for test in tests if "behaviour" in test])
    if shares.size < FEWEST:
        return _too_few(text, str(shares.size))
    crashes = np.array([test["crash_rate"] for test in tests])
    ours, verdict = _mostly(shares >= FOLLOWING)
    ours = (
        f"in {_percent(shares)} of the trials, {_percent(crashes)} crash; so in {ours}"
    )
    return Claim(text, ours, str(shares.size), verdict)


def following_share(test: dict) -> float:
    """Share of a champion's trials that followed walls, hugging them or not."""
    shares = test["behaviour"]
    return shares.get("wall follower", 0.0) + shares.get("hugger", 0.0)


def _compared(a: np.ndarray, b: np.ndarray) -> tuple[str, str]:
    """How far the runs of `a` exceed those of `b`, and the verdict on that."""
    effect, p = a12_interval(a, b), mann_whitney(a, b).p
    ours = (
        f"A12 {effect.value:.2f} [{effect.low:.2f}, {effect.high:.2f}], "
        f"p {probability(p)}"
    )
    if p >= LEVEL:
        return ours, UNTESTED
    return ours, CONSISTENT if effect.value > 0.5 else INCONSISTENT


def _mostly(holds: np.ndarray) -> tuple[str, str]:
    """In how many runs something holds, and whether that is most of all there are."""
    share = wilson(int(holds.sum()), holds.size)
    ours = f"{holds.sum()} of {holds.size} runs [{share.low:.0%}, {share.high:.0%}]"
    if share.low > 0.5:
        return ours, CONSISTENT
    return ours, INCONSISTENT if share.high < 0.5 else UNTESTED


def _too_few(text: str, n: str) -> Claim:
    return Claim(text, f"needs at least {FEWEST} runs of each", n, UNTESTED)


def _median(sample: np.ndarray) -> str:
    return _spread(sample, 1, ".1f", "")


def _percent(sample: np.ndarray) -> str:
    return _spread(sample, 100, ".0f", " %")


def _spread(sample: np.ndarray, scale: float, form: str, unit: str) -> str:
    """Median and quartiles for a person."""
    q = quartiles(sample * scale)
    return f"{q.median:{form}} [{q.lower:{form}}, {q.upper:{form}}]{unit}"


def verdicts(found: Sequence[Claim]) -> dict[str, int]:
    """How many claims came out which way."""
    return {
        verdict: sum(claim.verdict == verdict for claim in found)
        for verdict in (CONSISTENT, INCONSISTENT, UNTESTED)
    }
