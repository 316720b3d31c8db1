"""Tables of other programs or of anybody, in Parquet: sizes first, then rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from calibnet.errors import CalibnetError
from calibnet.runtime.reading import require_file
from calibnet.runtime.text import one_line

LARGEST = 1 << 30
"""Largest file in bytes."""
MOST_ROWS = 1_000_000
"""Most rows, of which a few kilobytes can hold any number."""


def read_rows(
    file: Path, what: str, error: type[CalibnetError], remedy: str, columns: Sequence[str] | None = None
) -> list[dict[str, Any]]:
    """The rows of a Parquet file.

    Args:
        file: the table.
        what: it is, for messages.
        error: that is raised.
        remedy: what to do about it.
        columns: those that are read where they are there; None for all.

    Raises:
        CalibnetError: it cannot be read, is no such table, or has more rows than `MOST_ROWS`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    require_file(file, what, LARGEST, error, remedy)
    try:
        with pq.ParquetFile(file) as table:
            count = table.metadata.num_rows
            if count > MOST_ROWS:
                raise error(f"{file} has {count:,} rows, and at most {MOST_ROWS:,} are read; {remedy}.")
            names = [name for name in table.schema_arrow.names if columns is None or name in columns]
            rows: list[dict[str, Any]] = table.read(names).to_pylist()
    except (pa.ArrowException, OSError, UnicodeDecodeError) as problem:
        raise error(f"{file} is not a Parquet table ({one_line(str(problem), 200)}); {remedy}.") from None
    return rows
