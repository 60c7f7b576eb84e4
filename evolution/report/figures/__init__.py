"""Figures of a study that a paper could print, each with its caption."""

from collections.abc import Callable, Iterator
from types import MappingProxyType

from matplotlib.figure import Figure

from evolution.report.figures.behaviour import behaviour, trajectories
from evolution.report.figures.champions import held_out, rungs, stored_and_held_out
from evolution.report.figures.curves import fitness, fitness_all, targets
from evolution.study.data import StudyData

Captioned = tuple[Figure, str]

FIGURES: MappingProxyType[str, Callable[[StudyData], Captioned | None]] = (
    MappingProxyType(
        {
            "fitness-all": fitness_all,
            "targets": targets,
            "held-out": held_out,
            "stored-and-held-out": stored_and_held_out,
            "rungs": rungs,
            "behaviour": behaviour,
            "trajectories": trajectories,
        }
    )
)
"""Figures of the whole study by file name; None where the study has nothing for it."""


def figures(data: StudyData) -> Iterator[tuple[str, Figure, str]]:
    """File name, figure and caption of each figure that the study has data for.

    First `fitness-<experiment>` of each experiment with runs, then `FIGURES`. There is
    at least one run, as `load_study` sees to.

    Raises:
        UserError: if the wheeled robot cannot use the arena.
    """
    for name in data.with_runs:
        yield f"fitness-{name}", *fitness(data, name)
    for name, draw in FIGURES.items():
        drawn = draw(data)
        if drawn is not None:
            yield name, *drawn
