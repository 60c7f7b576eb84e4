"""Figures of a measurement, as a JSON file."""

import json
from pathlib import Path
from typing import Any

from epuck_mj.host import files


def write_figures(path: Path | None, figures: Any) -> None:
    """Write figures to a file, or nowhere if the path is None.

    Raises:
        UserError: if it cannot be written.
    """
    if path is not None:
        with files.writing():
            files.write_text(path, json.dumps(figures, indent=1) + "\n")
