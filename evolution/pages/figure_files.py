"""Figures of a report as files, in three formats."""

import io
from collections.abc import Mapping
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from epuck_mj.host.files import write_bytes, writing
from evolution.pages.style import PRINT

FORMATS: Mapping[str, Mapping[str, None]] = {
    # matplotlib would name its version and the time
    "svg": {"Creator": None, "Date": None},
    "pdf": {"Creator": None, "Producer": None, "CreationDate": None},
    "png": {"Software": None},
}
"""File formats, each with the metadata to leave out."""


def write_figure(figure: Figure, folder: Path, name: str) -> None:
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
