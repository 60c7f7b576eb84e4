"""The page of the ladder: tables in Markdown, and a picture."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from benchmarks.ladder.controllers import (
    CHAMPION,
    CHAMPION_SEEDS,
    MADE_HERE,
    STUDIES,
    Tried,
)
from epuck_mj.host import files
from epuck_mj.show import colors
from epuck_mj.show.colors import fraction
from epuck_mj.show.pictures import save_figure
from evolution.pages.style import PAGE, PRINT
from evolution.statistics.estimates import rank_correlation

Column = Mapping[str, Sequence[float]]
"""Mean fitness and share of crashed trials, by controller."""

SETS: Mapping[str, Callable[[Tried], bool]] = {
    "all": lambda each: True,
    "shipped champions": lambda each: (
        each.kind == CHAMPION and not each.name.startswith(MADE_HERE)
    ),
    "champions of wheels": lambda each: (
        (each.kind, each.evolved_on) == (CHAMPION, "epuck")
    ),
    "champions of the kinematic robot alone": lambda each: each.name.startswith(
        MADE_HERE
    ),
    "not yet evolved far": lambda each: each.kind != CHAMPION,
}
"""Sets of controllers that are reported on their own."""

TOLERANCE = 0.05
"""Relative difference from which a controller is named."""

LEAST = 3.0
"""Difference of fitness below which none is named: poor controllers have little."""

REFERENCE = "reference"


def write_page(
    path: Path,
    measured: Mapping[str, Mapping[str, Column]],
    controllers: Sequence[Tried],
    starts: int,
) -> None:
    """Write the page and its picture.

    Args:
        path: of the Markdown file.
        measured: by arena and by column.
        controllers: that were tried.
        starts: trials of each in the first arena.
    """
    picture = path.with_suffix(".png")
    with matplotlib.rc_context(PRINT):
        save_figure(ladder_figure(next(iter(measured.values()))), picture, dpi=200)
    lines = [
        HEADER.format(
            n=len(controllers),
            starts=starts,
            seeds=CHAMPION_SEEDS,
            studies=",".join(STUDIES),
            picture=picture.name,
        )
    ]
    for arena, columns in measured.items():
        tried = [each for each in controllers if each.name in columns[REFERENCE]]
        lines += ["", f"## {arena}", "", *_differences(columns, tried)]
        lines += ["", *_by_experiment(columns, tried), "", *_named(columns, tried)]
    with files.writing():
        files.write_text(path, "\n".join(lines) + "\n")


def _differences(columns: Mapping[str, Column], tried: Sequence[Tried]) -> list[str]:
    """How far each rung is from the reference, by sets of controllers."""
    lines = [
        "| robot | controllers | n | mean difference | median difference | bias | "
        "largest | rank correlation | differ by more than 5 % |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, column in columns.items():
        if name == REFERENCE:
            continue
        for title, belongs in SETS.items():
            names = [each.name for each in tried if belongs(each)]
            if not names:
                continue
            true = np.array([columns[REFERENCE][each][0] for each in names])
            seen = np.array([column[each][0] for each in names])
            off = seen - true
            rho = rank_correlation(seen, true)
            lines.append(
                f"| {name} | {title} | {len(names)} | {np.abs(off).mean():.1f} | "
                f"{np.median(np.abs(off)):.1f} | "
                f"{off.mean():+.1f} | {off[np.abs(off).argmax()]:+.1f} | "
                f"{'' if rho is None else f'{rho:.3f}'} | {_many(off, true).sum()} |"
            )
    return lines


def _by_experiment(columns: Mapping[str, Column], tried: Sequence[Tried]) -> list[str]:
    """Mean differences from the reference of the champions of each experiment."""
    members: dict[str, list[str]] = {}
    for each in tried:
        if each.kind == CHAMPION:
            members.setdefault(each.name.rpartition("/")[0], []).append(each.name)
    rungs = [name for name in columns if name != REFERENCE]
    lines = [
        "Champions by experiment: median fitness on the reference, and mean size of "
        "the differences from it.",
        "",
        f"| experiment | n | {REFERENCE} | {' | '.join(rungs)} |",
        "|---|---:|---:|" + "---:|" * len(rungs),
    ]
    for experiment, names in members.items():
        true = np.array([columns[REFERENCE][name][0] for name in names])
        off = (
            np.abs(np.array([columns[rung][name][0] for name in names]) - true).mean()
            for rung in rungs
        )
        cells = [experiment, str(len(names)), f"{np.median(true):.0f}"]
        lines.append(f"| {' | '.join([*cells, *(f'{each:.1f}' for each in off)])} |")
    return lines


def _many(off: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Which differences are large enough to be named, `(n,)`."""
    return (np.abs(off) > TOLERANCE * true) & (np.abs(off) >= LEAST)


def _named(columns: Mapping[str, Column], tried: Sequence[Tried]) -> list[str]:
    """Controllers that lose or gain on a rung, with how often they crash on each."""
    rungs = list(columns)
    rows = []
    for each in tried:
        true = columns[REFERENCE][each.name][0]
        off = np.array([columns[rung][each.name][0] - true for rung in rungs])
        if not _many(off, np.full(len(off), true)).any():
            continue
        cells = [
            f"{fitness:.0f} ({crashed:.0%})"
            for fitness, crashed in (columns[rung][each.name] for rung in rungs)
        ]
        rows.append((-np.abs(off).max(), [each.name, each.evolved_on or "-", *cells]))
    if not rows:
        return ["No controller differs by more than 5 % anywhere."]
    head = ["controller", "evolved on", *rungs]
    lines = [
        "Controllers that differ by more than 5 % on a robot: mean fitness, and the "
        "share of trials that end in a crash.",
        "",
        f"| {' | '.join(head)} |",
        "|---|---|" + "---:|" * len(rungs),
    ]
    return lines + [f"| {' | '.join(cells)} |" for _, cells in sorted(rows)]


def ladder_figure(columns: Mapping[str, Column]) -> Figure:
    """Fitness of each controller on each rung against that on the reference."""
    rungs = [name for name in columns if name != REFERENCE]
    figure = Figure(figsize=(PAGE, PAGE / len(rungs) + 0.5), layout="constrained")
    panels = figure.subplots(1, len(rungs), sharex=True, sharey=True)
    for axes, rung in zip(np.atleast_1d(panels), rungs, strict=True):
        names = list(columns[REFERENCE])
        true = [columns[REFERENCE][name][0] for name in names]
        seen = [columns[rung][name][0] for name in names]
        axes.plot([0, 300], [0, 300], color="0.6", linewidth=0.8)
        axes.scatter(true, seen, s=6, color=fraction(colors.BLUE), alpha=0.7, lw=0)
        axes.set(title=rung.replace(", ", ",\n"), aspect="equal")
        axes.set(xlim=(0, 260), ylim=(0, 260), xlabel="reference")
    np.atleast_1d(panels)[0].set_ylabel("mean fitness, of 300")
    return figure


HEADER = """# How far the robots agree

Made by `make ladder`. {n} controllers drive from the same {starts} starts on each robot
and on the reference: the robot on wheels with a fifth of its physics step, where a
touch in any physics step is a crash. Controllers are the champions of the first {seeds}
runs of each experiment in `results/{{{studies}}}`, the best individuals of early and
middle generations of the first run on the kinematic robot, random genomes, the
hand-written wall follower, and champions of DE/best that were evolved and chosen on the
kinematic robot alone. In arenas other than the square, every third controller has a
quarter of these starts. Sensors are ideal. Fitness is of 300.

Differences are those of a controller's mean fitness on the robot from that on the
reference: their mean and median size, their mean (bias), and the largest. Those below 3
do not count as more than 5 %, as poor controllers have little fitness. *epuck, touches
at the end* is the robot on wheels when only those touches are crashes that last to the
end of a control step.

![Fitness on each robot against that on the reference]({picture})"""
