"""Figures of a study that a paper could print, each with its caption."""

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from types import MappingProxyType

import matplotlib
from matplotlib.figure import Figure

from epuck_mj.files import write_bytes, writing
from evolution.report.figures.behaviour import behaviour, trajectories
from evolution.report.figures.champions import held_out, rungs, stored_and_held_out
from evolution.report.figures.curves import fitness, fitness_all, targets
from evolution.report.figures.style import PRINT
from evolution.study_data import StudyData

FORMATS: MappingProxyType[str, MappingProxyType[str, None]] = MappingProxyType(
    {
        # matplotlib would name its version and the time
        "svg": MappingProxyType({"Creator": None, "Date": None}),
        "pdf": MappingProxyType(
            {"Creator": None, "Producer": None, "CreationDate": None}
        ),
        "png": MappingProxyType({"Software": None}),
    }
)
"""File formats, each with what to leave out of it."""

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


def save(figure: Figure, folder: Path, name: str) -> None:
    """Write SVG, PDF and PNG; equal figures make equal files.

    Raises:
        UserError: if one cannot be written.
    """
    for form, metadata in FORMATS.items():
        content = io.BytesIO()
        with matplotlib.rc_context(PRINT):
            figure.savefig(content, format=form, dpi=200, metadata=dict(metadata))
        path = folder / f"{name}.{form}"
        with writing():
            write_bytes(path, content.getvalue())
