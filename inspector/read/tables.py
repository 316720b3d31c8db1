"""A recording's chunks as rows of plain values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from calibnet.geometry.types import Extrinsic
from inspector import entities
from inspector.read.understood import extrinsic_of

if TYPE_CHECKING:
    from pyarrow import RecordBatch

PROPERTIES = "__properties"
"""Entity under which Rerun keeps a recording's name and properties."""


def rows(batches: Iterable[RecordBatch]) -> Iterator[dict[str, Any]]:
    """Rows as dictionaries by component; times in seconds."""
    for batch in batches:
        for row in batch.to_pylist():
            if entities.TIME in row:
                row[entities.TIME] = row[entities.TIME].total_seconds()
            yield row


def static_row(batches: Iterable[RecordBatch]) -> dict[str, list[Any]]:
    """The one row of an entity's static data, as lists by component; empty without any."""
    return {
        name: batch[name][0].as_py()
        for batch in batches
        if batch.num_rows
        for name in batch.schema.names
        if not name.startswith("rerun.")
    }


def matrices(batches: Iterable[RecordBatch]) -> dict[int, Extrinsic]:
    """4x4 extrinsics by frame.

    Raises:
        ValueError: one is not a rigid transform.
    """
    return {row[entities.FRAME]: extrinsic_of(row[entities.MATRIX]) for row in rows(batches)}
