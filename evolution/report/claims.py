"""The paper's claims held against a study: our number, its interval, n, a verdict.

A claim is consistent or inconsistent only where the data say so: where an interval
leaves both open, or there are fewer runs than the paper had, it cannot be tested.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from evolution.comparisons import a12_interval
from evolution.statistics import quartiles
from evolution.study_data import StudyData

CONSISTENT, INCONSISTENT, UNTESTED = "consistent", "inconsistent", "can't be tested"

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
    return found


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
    effect = a12_interval(a, b)
    ours = (
        f"medians {_median(a)} and {_median(b)}; A12 {effect.value:.2f} "
        f"[{effect.low:.2f}, {effect.high:.2f}]"
    )
    return Claim(text, ours, n, _side(effect.low - 0.5, effect.high - 0.5))


def _maximum(stored: dict[str, np.ndarray], name: str) -> Claim:
    """Whether the paper's maximum lies among those of our runs."""
    sample, paper = stored[name], PAPER_BEST[name]
    text = f"{DISPLAY[name]} reaches a maximum fitness of {paper}"
    if sample.size < FEWEST:
        return _too_few(text, str(sample.size))
    low, high = sample.min(), sample.max()
    ours = f"median {_median(sample)}, runs from {low:.1f} to {high:.1f}"
    inside = low <= paper <= high
    return Claim(text, ours, str(sample.size), CONSISTENT if inside else INCONSISTENT)


def _approaches(gap: dict[str, np.ndarray], name: str) -> Claim:
    """DE: the mean ends closer to the best than the GA's does."""
    text = f"{DISPLAY[name]}'s mean approaches its best, more than the GA's"
    a, b = gap[name], gap["ga"]
    n = f"{a.size} and {b.size}"
    if min(a.size, b.size) < FEWEST:
        return _too_few(text, n)
    effect = a12_interval(a, b)
    ours = (
        f"final mean / best {_percent(a)}, GA {_percent(b)}; A12 {effect.value:.2f} "
        f"[{effect.low:.2f}, {effect.high:.2f}]"
    )
    return Claim(text, ours, n, _side(effect.low - 0.5, effect.high - 0.5))


def _stays_apart(gap: dict[str, np.ndarray]) -> Claim:
    text = "the GA's mean stays far from its best (read as: below two thirds)"
    sample = gap["ga"]
    if sample.size < FEWEST:
        return _too_few(text, str(sample.size))
    ours = f"final mean / best {_percent(sample)}"
    verdict = _mostly(sample < 2 / 3)
    return Claim(text, ours, str(sample.size), verdict)


def _mature_early(early: dict[str, np.ndarray], name: str) -> Claim:
    text = (
        f"{DISPLAY[name]} has mature individuals early (read as: {MATURE:.0%} of its "
        f"final best within {EARLY:.0%} of the budget)"
    )
    sample = early[name]
    if sample.size < FEWEST:
        return _too_few(text, str(sample.size))
    ours = f"after {_percent(sample)} of the budget"
    return Claim(text, ours, str(sample.size), _mostly(sample <= EARLY))


def _follows(study: StudyData, name: str) -> Claim:
    """Finds a wall, follows it, does not crash: on wheels."""
    robot = study.robots[-1]
    text = (
        f"{DISPLAY[name]}'s best finds a wall and follows it without crashing (read "
        f"as: in {FOLLOWING:.0%} of its trials on {robot})"
    )
    tests = [run.champion.scores["held_out"][robot] for run in study.runs.get(name, ())]
    shares = np.array([following_share(test) for test in tests if "behaviour" in test])
    if shares.size < FEWEST:
        return _too_few(text, str(shares.size))
    crashes = np.array([test["crash_rate"] for test in tests])
    ours = f"in {_percent(shares)} of the trials; {_percent(crashes)} crash"
    return Claim(text, ours, str(shares.size), _mostly(shares >= FOLLOWING))


def following_share(test: dict) -> float:
    """Share of a champion's trials that followed walls, hugging them or not."""
    shares = test["behaviour"]
    return shares.get("wall follower", 0.0) + shares.get("hugger", 0.0)


def _side(low: float, high: float) -> str:
    """The verdict of an interval around a difference that should be positive."""
    if low > 0:
        return CONSISTENT
    return INCONSISTENT if high < 0 else UNTESTED


def _mostly(holds: np.ndarray) -> str:
    """Consistent if it holds in three of four runs, inconsistent in at most one."""
    share = holds.mean()
    if share >= 0.75:
        return CONSISTENT
    return INCONSISTENT if share <= 0.25 else UNTESTED


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
