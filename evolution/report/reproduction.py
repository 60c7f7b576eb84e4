"""REPRODUCTION.md: the paper's claims, what stored fitness hides, what differs."""

from collections.abc import Sequence

import numpy as np

from evolution.report.claims import DISPLAY, Claim, claims, held_out_order, verdicts
from evolution.statistics import quartiles
from evolution.study_data import StudyData

DIFFERENCES = (
    ("simulator", "Player/Stage, 2D", "MuJoCo, 3D; planar robot, tested on wheels"),
    ("steps of a trial", "not legible", "{steps} of {control_step} s"),
    ("arena", "square, as in their laboratory", "1.0 m square"),
    ("speeds", "not said", "{v_max} m/s and {w_max} rad/s, the hardware's limits"),
    ("sensors", "0 near to 1 free, 4 cm", "the same, linear, without noise"),
    (
        "fitness",
        "equation (2), which as printed rewards circles in the open",
        "its prose: fast, straight and near a wall, multiplied",
    ),
    ("weights", "range not said", "within +-{weight_bound}, no biases"),
    ("DE outside the bounds", "not said", "midpoint between parent and bound"),
    ("GA coding", "binary; tournament size not legible", "8 bits, tournament of 5"),
    (
        "budget",
        "30,000 evaluations, though 250 generations of 150 are 37,500",
        "{evaluations:,} evaluations for every algorithm",
    ),
    (
        "starts",
        "random",
        "fresh for every generation, the same for all its individuals",
    ),
    ("replicates", '"at least three"', "n as stated beside each number"),
    ("the best", "highest stored fitness", "chosen on 200 starts, reported on 1,000"),
    ("robot", "a physical e-puck", "none"),
)
"""What, in the paper, here."""


def reproduction(study: StudyData, wheels: StudyData | None, made_by: str) -> str:
    """The text of REPRODUCTION.md.

    Args:
        study: evolved on the plane.
        wheels: evolved on wheels from the start, if there is one.
        made_by: the command that wrote it.
    """
    found = claims(study)
    counts = ", ".join(f"{n} {verdict}" for verdict, n in verdicts(found).items())
    parts = [
        "# Reproduction",
        "A replication with another simulator and our own code, of a study that is "
        "probably Cruz-Alvarez, Montes-Gonzalez, Mezura-Montes and Santos (MICAI "
        "2012).",
        f"Made by `{made_by}` from `{study.path.name}`. Brackets hold quartiles, for "
        "A12 95 % confidence bounds; n counts runs. A claim about an order is decided "
        "only if the bounds of A12 leave 0.5 out; the claims are not adjusted for "
        "their number.",
        "## What there is",
        runs_table(study),
    ]
    if study.missing:
        parts += ["Missing:", _bullets(study.missing)]
    parts += [
        "## The paper's claims",
        f"{counts[:1].upper()}{counts[1:]}. These are claims about *stored* fitness, "
        "as the paper measured it.",
        _claims(found),
        "## The same order by fresh starts",
        "What the paper could not see: champions on 1,000 starts that evolution never "
        "met.",
    ]
    parts += [_claims(held_out_order(study, robot)) for robot in study.robots]
    parts += ["## What stored fitness hides", _hidden(study), _believed(study)]
    parts += ["## From the plane to wheels", _rungs(study)]
    if wheels is not None:
        parts += ["## Evolved on wheels from the start", runs_table(wheels)]
        parts += ["Missing:", _bullets(wheels.missing)] if wheels.missing else []
        parts += [_claims(held_out_order(wheels, wheels.robots[-1]))]
    parts += ["## What differs from the original", _differences(study)]
    return "\n\n".join(part for part in parts if part) + "\n"


def runs_table(study: StudyData) -> str:
    """The main table: held-out fitness first, then stored, of every experiment."""
    rows = []
    for name, runs in study.runs.items():
        if not runs:
            continue
        config = study.configs[name]
        tests = [_quartiles(study.held_out(name, robot)) for robot in study.robots]
        rows.append(
            [
                DISPLAY.get(name, name),
                len(runs),
                f"{config.evaluations:,}",
                *tests,
                _quartiles(study.stored(name)),
            ]
        )
    if study.yardstick:
        means = [f"{study.yardstick[robot]['mean']:.1f}" for robot in study.robots]
        rows.append(["written by hand", "", "", *means, ""])
    header = ["algorithm", "n", "evaluations"]
    header += [f"held-out, {robot}" for robot in study.robots]
    return _table([*header, "stored"], rows)


def _claims(found: Sequence[Claim]) -> str:
    rows = [[claim.text, claim.ours, claim.n, claim.verdict] for claim in found]
    return _table(["claim", "here", "n", "verdict"], rows)


def _hidden(study: StudyData) -> str:
    """Stored against held-out fitness of the champions, in words."""
    robot, lines = study.robots[0], []
    for name, runs in study.runs.items():
        if runs:
            luck = study.stored(name) - study.held_out(name, robot)
            lines.append(
                f"{DISPLAY.get(name, name)}: the champions' stored fitness is "
                f"{_quartiles(luck)} above what 1,000 starts on {robot} say "
                f"(n = {len(runs)})."
            )
    return _bullets(lines)


def _believed(study: StudyData) -> str:
    """What whoever trusts stored fitness would have taken home."""
    rows = []
    for name, runs in study.runs.items():
        scores = [run.champion.scores.get("most_believed") for run in runs]
        pairs = np.array([[s["stored"], s["held_out"]] for s in scores if s])
        if len(pairs):
            champions = study.held_out(name, study.robots[0])
            rows.append(
                [
                    DISPLAY.get(name, name),
                    len(pairs),
                    _quartiles(pairs[:, 0]),
                    _quartiles(pairs[:, 1]),
                    f"{pairs[:, 1].min():.1f}",
                    _quartiles(champions),
                ]
            )
    if not rows:
        return ""
    table = _table(
        ["algorithm", "n", "highest stored", "its held-out", "worst run", "champion's"],
        rows,
    )
    return (
        "The individual with the highest stored fitness of each run, which the paper "
        f"would report, on fresh starts ({study.robots[0]}); last, the champion chosen "
        f"on validation starts.\n\n{table}"
    )


def _rungs(study: StudyData) -> str:
    """How much of the planar fitness champions keep on wheels."""
    if len(study.robots) < 2:
        return "Both rungs are the same robot here."
    first, last = study.robots[0], study.robots[-1]
    lines = []
    for name, runs in study.runs.items():
        if runs:
            kept = 100 * study.held_out(name, last) / study.held_out(name, first)
            lines.append(
                f"{DISPLAY.get(name, name)}: {_quartiles(kept)} % of the held-out "
                f"fitness on {first} is kept on {last} (n = {len(runs)})."
            )
    return _bullets(lines)


def _differences(study: StudyData) -> str:
    config = next(iter(study.configs.values())).model_dump()
    rows = [[what, paper, here.format(**config)] for what, paper, here in DIFFERENCES]
    return _table(["", "paper", "here"], rows)


def _quartiles(sample: np.ndarray) -> str:
    q = quartiles(sample)
    if sample.size == 1:
        return f"{q.median:.1f}"
    return f"{q.median:.1f} [{q.lower:.1f}, {q.upper:.1f}]"


def _bullets(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
