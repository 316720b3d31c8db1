"""Indexes a finished recording: rewrites it in few large chunks, with the footer that lists them.

During a run, every frame is written to the file at once, in one chunk per entity, so that a kill loses only the current
frame. These chunks are too many to keep: each costs 3 kB of file, and Rerun's file sink keeps 11 kB of memory of each
for the footer. A growing recording therefore has no footer, and memory does not grow with it; this module adds the
footer afterwards. How chunks are cut depends only on the data, not on the pace of the run.
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
"""Size of a chunk, as in Rerun's own `rrd optimize`; at most this much of every entity is held in memory."""
MOST_BATCHES = 32
"""Largest number of batches of an entity's rows that are held at the same time."""
ROUND_BYTES, ROUND_SHARE = 8 << 20, 2
"""Bytes between two rounds at which all chunks end whatever their size: at least the first, and a half (by the second)
of what was written before. The front part of an incomplete copy is then of use, and chunks remain few."""
SORTED = b"rerun:is_sorted"
"""Metadata of a column that is known to be sorted; without it, Rerun checks again."""


class NotIndexedError(CalibnetError):
    """The recording is complete but has no index, for lack of disk space or because of an interruption."""

    def __init__(self, file: Path, why: str, remedy: str) -> None:
        """Make the sentence from the reason and the remedy."""
        super().__init__(
            f"{file} has no index, {why}, and opens more slowly; {remedy}: rerun rrd optimize {file} -o NEW.rrd."
        )


def index(
    file: Path, opened: Callable[[Path], rr.RecordingStream], advance: Callable[[int, int], bool] | None = None
) -> None:
    """Rewrite a recording with its footer; the original is kept until the new file is complete.

    Args:
        file: a recording without a footer that is no longer being written.
        opened: opens a stream of the same recording to another file, with its blueprint.
        advance: called repeatedly with the bytes written and the approximate total; returns whether to go on.

    Raises:
        NotIndexedError: the disk has no room, or ``advance`` returned false; the recording is unchanged.
        RecordingLostError: the new file cannot be written, for instance because of a quota; likewise.
        OSError: the file cannot be replaced.
    """
    size = file.stat().st_size
    if shutil.disk_usage(file.parent).free < size:
        raise NotIndexedError(
            file, f"since the disk lacks {size / 1e6:.0f} MB for it", "to add it, free some space and run"
        )

    def write(partial: Path) -> None:
        stream = opened(partial)
        for chunk in merged(_chunks(file)):
            rr.send_chunks(chunk, recording=stream)
            flush(stream)
            if advance is not None and not advance(partial.stat().st_size, size):
                stream.disconnect()
                raise NotIndexedError(file, "since indexing was interrupted", "to add it, run")
        stream.disconnect()

    write_whole(file, write, Kind.RECORDING)


def merged(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
    """The same data in fewer chunks, of `CHUNK_BYTES` where an entity has that much."""
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
    """The chunk of every entity, sorted by name, since Rerun's order varies."""
    yield from (held[key].chunk(key[1]) for key in sorted(held))


class _Rows:
    """Rows of an entity that will form one chunk."""

    def __init__(self) -> None:
        self.size = 0
        self._batches: list[pa.RecordBatch] = []

    def fits(self, batch: pa.RecordBatch) -> bool:
        """Whether the rows have the same types."""
        return bool(self._batches[0].schema.equals(batch.schema))

    def add(self, batch: pa.RecordBatch) -> None:
        """Add rows; batches are joined, since many small ones take far more memory than their content."""
        self.size += batch.nbytes
        self._batches.append(batch)
        if len(self._batches) >= MOST_BATCHES:
            self._batches = [self._joined()]

    def chunk(self, is_static: bool) -> Chunk:
        """A chunk of all rows or, for static data, of the last row, which overrides the others."""
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
        warnings.simplefilter("ignore")  # the missing footer
        return RrdReader(file).stream()
