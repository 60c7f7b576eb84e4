"""Pages as files, in Markdown and HTML, and their figures in three formats."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from epuck_mj.host.files import write_bytes, write_text, writing
from evolution.pages.blocks import (
    FIGURES_FOLDER,
    Block,
    Picture,
    to_html,
    to_markdown,
)
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


def write_pictures(
    folder: Path, figures: Mapping[str, Figure], captions: Mapping[str, str]
) -> list[Picture]:
    """Write figures below a page's folder; they as a page shows them, in their order.

    Args:
        folder: of the page; made if it is not there.
        figures: by name.
        captions: of each.

    Raises:
        UserError: if one cannot be written.
    """
    place = folder / FIGURES_FOLDER
    with writing():
        place.mkdir(parents=True, exist_ok=True)
    pictures = []
    for name, figure in figures.items():
        write_figure(figure, place, name)
        svg = (place / f"{name}.svg").read_bytes()
        pictures.append(Picture(name, captions[name], svg))
    return pictures


def write_page(folder: Path, name: str, title: str, blocks: Sequence[Block]) -> Path:
    """Write `name`.md and `name`.html; the path of the first.

    Raises:
        UserError: if one cannot be written.
    """
    path = folder / f"{name}.md"
    with writing():
        write_text(path, to_markdown(blocks))
        write_text(folder / f"{name}.html", to_html(title, blocks))
    return path
