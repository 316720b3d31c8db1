"""The end of a recording: written anew in few large chunks, with the footer that lists them.

While a run goes on, every frame is handed to the file at once, in a chunk an entity, so that a kill loses only the
frame in work. Those are too many chunks for good: each costs 3 kB of file, and Rerun's file sink keeps 11 kB of memory
of each for the footer. So a growing recording has no footer, and memory does not grow with it; this module makes it
one afterwards. How chunks are cut depends on what is recorded alone, not on the pace of the run.
"""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from calibnet.errors import CalibnetError
from calibnet.runtime.writing import Kind, write_whole
from inspector.record.flushing import flush

if TYPE_CHECKING:
    from rerun.chunk import LazyChunkStream

CHUNK_BYTES = 2 << 20
"""Size of a chunk, as Rerun's own `rrd optimize` cuts them; at most so much of every entity is held in memory."""
MOST_BATCHES = 32
"""Most batches of an entity's rows that are held at the same time."""
ROUND_BYTES, ROUND_SHARE = 8 << 20, 2
"""What comes between two rounds, in which chunks end whatever their size: so many bytes at least, and half of what was
written before. So the front part of a file, as of a copy that is not complete, is of use, and chunks remain few."""
SORTED = b"rerun:is_sorted"
"""Metadata of a column that was found to be sorted; Rerun finds that out anew where it is not said."""


class NotIndexedError(CalibnetError):
    """The recording keeps its data but gets no index: there is no room for a second copy, or it was not waited for."""

    def __init__(self, file: Path, why: str, remedy: str) -> None:
        """Say why, and when to do what."""
        super().__init__(
            f"{file} has no index, {why}, and is read like one that was cut off; {remedy}: "
            f"rerun rrd optimize {file} -o NEW.rrd."
        )


def index(
    file: Path, opened: Callable[[Path], rr.RecordingStream], advance: Callable[[int, int], bool] | None = None
) -> None:
    """Write a recording anew with its footer; what it was before stays until that is complete.

    Args:
        file: a recording without a footer, which nothing writes to any more.
        opened: makes the stream of the same recording to another file, with its blueprint.
        advance: called again and again with the bytes written and about how many there will be; says whether to go on.

    Raises:
        NotIndexedError: the disk has no room for it, or ``advance`` said no; the recording stays as it is.
        RecordingLostError: it can no longer be written, for instance because of a quota; likewise.
        OSError: the file cannot be replaced.
    """
    size = file.stat().st_size
    if shutil.disk_usage(file.parent).free < size:
        raise NotIndexedError(file, f"for which the disk lacks {size / 1e6:.0f} MB", "with more room")

    def write(partial: Path) -> None:
        stream = opened(partial)
        for chunk in merged(_chunks(file)):
            rr.send_chunks(chunk, recording=stream)
            flush(stream)
            if advance is not None and not advance(partial.stat().st_size, size):
                stream.disconnect()
                raise NotIndexedError(file, "as its making was interrupted", "to make it")
        stream.disconnect()

    write_whole(file, write, Kind.RECORDING)


def merged(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
    """The same in fewer chunks, of `CHUNK_BYTES` where there is so much of an entity."""
    held: dict[tuple[str, bool, tuple[str, ...]], _Rows] = {}
    before = now = 0
    for chunk in chunks:
        batch = chunk.to_record_batch()
        key = (chunk.entity_path, chunk.is_static, tuple(batch.schema.names))
        if key in held and not held[key].fits(batch):
            yield held.pop(key).chunk(chunk.is_static)
        rows = held.setdefault(key, _Rows())
        rows.add(batch)
        now += batch.nbytes
        if rows.size >= CHUNK_BYTES:
            yield held.pop(key).chunk(chunk.is_static)
        if now >= max(ROUND_BYTES, before / ROUND_SHARE):
            yield from _in_order(held)
            before, now = before + now, 0
            held = {}
    yield from _in_order(held)


def _in_order(held: dict[tuple[str, bool, tuple[str, ...]], _Rows]) -> Iterator[Chunk]:
    """Every entity's chunk, by its name: Rerun hands them over in an order of its own."""
    yield from (held[key].chunk(key[1]) for key in sorted(held))


class _Rows:
    """Rows of an entity that will be one chunk."""

    def __init__(self) -> None:
        self.size = 0
        self._batches: list[pa.RecordBatch] = []

    def fits(self, batch: pa.RecordBatch) -> bool:
        """Whether other rows are of the same types."""
        return bool(self._batches[0].schema.equals(batch.schema))

    def add(self, batch: pa.RecordBatch) -> None:
        """Take more rows in; many small batches would take far more memory than what they hold."""
        self.size += batch.nbytes
        self._batches.append(batch)
        if len(self._batches) >= MOST_BATCHES:
            self._batches = [self._joined()]

    def chunk(self, is_static: bool) -> Chunk:
        """All rows; of what holds at all times the last one, which the others gave way to."""
        rows = self._joined()
        last = rows.slice(rows.num_rows - 1)
        alone = is_static and not any(column.null_count for column in last.columns)
        (chunk,) = Chunk.from_record_batch(last if alone else rows)
        return chunk

    def _joined(self) -> pa.RecordBatch:
        schema = self._batches[0].schema
        for number, field in enumerate(schema):
            kept = {name: value for name, value in (field.metadata or {}).items() if name != SORTED}
            schema = schema.set(number, field.with_metadata(kept))
        (joined,) = pa.Table.from_batches(self._batches).combine_chunks().to_batches()
        return pa.RecordBatch.from_arrays(joined.columns, schema=schema)


def _chunks(file: Path) -> LazyChunkStream:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is no footer
        return RrdReader(file).stream()
