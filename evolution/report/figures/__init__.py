"""Figures of a study that a paper could print, each with its caption."""

from collections.abc import Callable, Iterator, Mapping

from matplotlib.figure import Figure

from evolution.report.figures.behaviour_bars import behaviour_figure
from evolution.report.figures.champions import (
    held_out_figure,
    rungs_figure,
    stored_and_held_out_figure,
)
from evolution.report.figures.curves import (
    growth_figure,
    growths_figure,
    targets_figure,
)
from evolution.report.figures.margins import margins_of_study_figure
from evolution.report.figures.trajectories import trajectories_figure
from evolution.study.data import StudyData

Captioned = tuple[Figure, str]

STUDY_FIGURES: Mapping[str, Callable[[StudyData], Captioned | None]] = {
    "fitness-all": growths_figure,
    "targets": targets_figure,
    "held-out": held_out_figure,
    "stored-and-held-out": stored_and_held_out_figure,
    "rungs": rungs_figure,
    "behaviour": behaviour_figure,
    "margins": margins_of_study_figure,
    "trajectories": trajectories_figure,
}
"""Figures of the whole study by file name; None where the study has nothing for it."""


def drawn_figures(data: StudyData) -> Iterator[tuple[str, Figure, str]]:
    """File name, figure and caption of each figure that the study has data for.

    First `fitness-<experiment>` of each experiment with runs, then `STUDY_FIGURES`.
    There is at least one run, as `load_study` sees to.

    Raises:
        UserError: if the wheeled robot cannot use the arena.
    """
    for name in data.with_runs:
        yield f"fitness-{name}", *growth_figure(data, name)
    for name, draw in STUDY_FIGURES.items():
        drawn = draw(data)
        if drawn is not None:
            yield name, *drawn
