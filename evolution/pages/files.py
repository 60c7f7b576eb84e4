"""Files of a report: figures in three formats, tables as CSV."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from epuck_mj.host.files import write_bytes, writing
from evolution.pages.style import PRINT

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


def csv_text(columns: Sequence[str], rows: Iterable[Any]) -> str:
    """The text of a CSV file with exact floats; None is an empty cell.

    Args:
        columns: names, in order.
        rows: mappings or dataclasses.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(row if isinstance(row, dict) else asdict(row) for row in rows)
    return text.getvalue()
