"""Pictures as files, complete or not written at all; equal pictures, equal bytes."""

import io
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.image import imread, imsave

from epuck_mj.host.files import write_bytes, writing

# matplotlib would name its version
UNSIGNED = {"Software": None}


def save_figure(figure: Figure, path: str | Path, dpi: int = 150) -> None:
    """Write a figure as PNG.

    Raises:
        UserError: if it cannot be written.
    """
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=dpi, metadata=UNSIGNED)
    with writing():
        write_bytes(Path(path), content.getvalue())


def save_below(picture: bytes, rows: int, path: str | Path) -> None:
    """Write a PNG without its upper rows, as PNG.

    Raises:
        UserError: if it cannot be written.
    """
    pixels = imread(io.BytesIO(picture), format="png")[rows:]
    content = io.BytesIO()
    imsave(content, pixels, format="png", metadata={"Software": "epuck_mj"})
    with writing():
        write_bytes(Path(path), content.getvalue())
