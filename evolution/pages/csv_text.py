"""Tables of a report as CSV."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any


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
