"""Parquet files: written in full or not at all, the same bytes for the same table."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from epuck_mj.errors import UserError
from epuck_mj.host import files

MOST = 1_000_000_000
"""Most bytes of a table's file."""


def write_table(path: Path, table: pa.Table) -> None:
    """Replace a file by a table, compressed.

    Floats are stored byte by byte, all first bytes before all second ones, which
    compresses better; whatever repeats itself is stored by its distinct values. Both
    read back exactly.
    """
    floats = [
        field.name
        for field in table.schema
        if pa.types.is_floating(field.type) and field.name not in REPEATING
    ]
    others = [field.name for field in table.schema if field.name not in floats]
    settings: dict[str, Any] = {
        "compression": "zstd",
        "compression_level": 9,
        "use_dictionary": [name for name in others if name not in LISTS],
        "use_byte_stream_split": floats,
        "write_statistics": False,
        "write_page_checksum": True,
        "row_group_size": max(1, table.num_rows),
    }
    sink = pa.BufferOutputStream()
    # equal tables can be in unequal pieces, which would end up in the file
    pq.write_table(table.combine_chunks(), sink, **settings)
    files.write_bytes(path, sink.getvalue().to_pybytes())


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Replace a file by a table of rows, each with its values by column."""
    write_table(path, pa.Table.from_pylist([*rows]))


REPEATING = ("crash_rate", "reference")
"""Columns of floats with few distinct values."""

LISTS = ("genome", "best_stored_genome")
"""Columns of lists without equal values."""


def read_table(path: Path, names: Collection[str] = (), some: bool = False) -> pa.Table:
    """The table in a file.

    Args:
        path: of the file.
        names: of columns that have to be there.
        some: read these columns only.

    Raises:
        UserError: if it cannot be read, or lacks a column.
    """
    content = pa.BufferReader(files.read_bytes(path, MOST))
    try:
        file = pq.ParquetFile(content, page_checksum_verification=True)
        missing = [name for name in names if name not in file.schema_arrow.names]
        if missing:
            raise ValueError(f"it has no column {missing[0]}")
        return file.read(columns=list(names) if some else None, use_threads=False)
    # arrow raises a dozen kinds for damaged files
    except Exception as error:
        reason = " ".join(str(error).split())
        raise UserError(f"cannot read '{path}': {reason}") from None


def with_values(
    table: pa.Table, names: Sequence[str], values: Sequence[Any]
) -> pa.Table:
    """The rows of a table that have these values in these columns.

    Raises:
        KeyError: if it lacks a column.
    """
    columns = zip(*(table[name].to_pylist() for name in names), strict=True)
    return table.filter(
        pa.array([each == tuple(values) for each in columns], pa.bool_())
    )
