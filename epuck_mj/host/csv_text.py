"""Tables as text of comma-separated values."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """The text of a CSV file with exact floats; None is an empty cell.

    Args:
        columns: names, in order.
        rows: values by column.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def csv_columns(text: str) -> dict[str, list[str]]:
    """Columns of the text of a CSV file, by name; empty what a row lacks.

    Raises:
        ValueError: if it is no such text.
    """
    try:
        header, *rows = [*csv.reader(text.splitlines())] or [[]]
    except csv.Error as error:
        raise ValueError(str(error)) from None
    return {
        name: [row[i] if i < len(row) else "" for row in rows]
        for i, name in enumerate(header)
    }
