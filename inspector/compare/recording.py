"""Writes a comparison: the runs' overlays and error curves on one timeline, each run under its own name.

Only what a view shows is copied, without raw volumes and activations.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from inspector import entities
from inspector.colors import GROUND, Rgb
from inspector.compare.blueprint import COMPARISON_TABLE, LEGEND_RUNS, make_comparison_blueprint
from inspector.compare.comparison import ComparedRun, Comparison, of_kind
from inspector.compare.table import comparison_table
from inspector.record.pictures.legends import log_names
from inspector.record.stream import Stream
from inspector.record.subtree import Subtree

if TYPE_CHECKING:
    from pyarrow import RecordBatch

SHARED = (f"{entities.IMAGE}/**", f"{entities.OVERLAY_REFERENCE}/**")
"""Entities that are the same in all runs, and are copied from the first."""
OWN = tuple(
    f"{entity}/**"
    for entity in (
        entities.OVERLAY_MISCALIBRATED,
        entities.OVERLAY_CORRECTED,
        entities.OVERLAY_DRIVE,
        entities.LEGEND_POINTS,
    )
)
"""Entities that are copied from every run."""
RUN_COLORS: tuple[Rgb, ...] = ((80, 170, 255), (255, 140, 40), (80, 220, 110), (190, 130, 255), (255, 205, 60))
DRIVES_ARE_LEVEL = "flat line: whole drive as one"
"""Text of the legend on lines that are the same at all frames."""
CHUNKS_A_FLUSH = 16


def record_comparison(comparison: Comparison, sinks: Sequence[Any]) -> str:
    """Write the comparison.

    Args:
        comparison: the runs.
        sinks: files and Rerun sinks, see `inspector.record.outputs`.

    Returns:
        A note for the user on how the recording was closed; empty for none.

    Raises:
        RecordingError: a run's recording is damaged.
        RecordingLostError: the recording cannot be written any more.
    """
    blueprint = make_comparison_blueprint(comparison)
    stream = Stream(entities.COMPARISON_APPLICATION_ID, _recording_id(comparison), comparison.title, sinks, blueprint)
    try:
        table = rr.TextDocument(comparison_table(comparison), media_type=rr.MediaType.MARKDOWN)
        stream.rec.log(COMPARISON_TABLE, table, static=True)
        shown = {run.name: RUN_COLORS[number % len(RUN_COLORS)] for number, run in enumerate(comparison.runs)}
        words = {DRIVES_ARE_LEVEL: GROUND} if any(run.run.drive_error for run in comparison.runs) else {}
        log_names(Subtree(stream.rec), LEGEND_RUNS, shown | words)
        for run in comparison.runs:
            _log_curves(stream.rec, run, shown[run.name])
        for count, chunk in enumerate(_copied(comparison), start=1):
            rr.send_chunks(chunk, recording=stream.rec)
            if count % CHUNKS_A_FLUSH == 0:
                stream.flush()
    finally:
        stream.close()
    return stream.remark


def _log_curves(rec: rr.RecordingStream, run: ComparedRun, color: Rgb) -> None:
    """Log the errors of the result, computed from the extrinsics since a recording need not have curves."""
    errors = [error for frame in run.frames if (error := frame.error(frame.corrected)) is not None]
    if len(errors) < len(run.frames):
        return
    times = [
        rr.TimeColumn(entities.FRAME, sequence=[frame.index for frame in run.frames]),
        rr.TimeColumn(entities.TIME, duration=[frame.seconds for frame in run.frames]),
    ]
    drive = [] if run.run.drive_error is None else [run.run.drive_error] * len(errors)
    for kind in entities.ERROR_KINDS:
        path = run.path(entities.error_corrected(kind))
        rec.send_columns(path, times, rr.Scalars.columns(scalars=[of_kind(error, kind) for error in errors]))
        line = rr.SeriesLines(names=run.name, colors=color, widths=2.0)
        rec.log(path, line, rr.SeriesPoints(names=run.name, colors=color, marker_sizes=3.0), static=True)
        if drive:
            path = run.path(entities.error_drive(kind))
            rec.send_columns(path, times, rr.Scalars.columns(scalars=[of_kind(error, kind) for error in drive]))
            rec.log(path, rr.SeriesLines(names=f"{run.name}, drive", colors=color, widths=1.0), static=True)


def _copied(comparison: Comparison) -> Iterator[Chunk]:
    """All chunks under their new paths, reduced to the frames that are compared."""
    wanted = np.array(comparison.indices)
    referenced = [run for run in comparison.runs if run.run.has_reference]
    for chunk in (referenced or comparison.runs)[0].run.chunks(*SHARED):
        yield from _only(chunk, wanted)
    for run in comparison.runs:
        for chunk in run.run.chunks(*OWN):
            for kept in _only(chunk, wanted):
                yield kept.with_entity_path(f"/{run.path(chunk.entity_path.lstrip('/'))}")


def _only(chunk: Chunk, frames: np.ndarray[Any, np.dtype[np.int64]]) -> list[Chunk]:
    """The chunk's rows of some frames; static data is kept as it is."""
    if chunk.is_static:
        return [chunk]
    batch: RecordBatch = chunk.to_record_batch()
    kept = np.isin(np.asarray(batch[entities.FRAME]), frames)
    if kept.all():
        return [chunk]
    return Chunk.from_record_batch(batch.take(np.flatnonzero(kept))) if kept.any() else []


def _recording_id(comparison: Comparison) -> str:
    """A recording id that is the same for the same runs, frames and names."""
    runs = [(run.name, run.run.title, sorted(run.run.settings.items())) for run in comparison.runs]
    text = repr((runs, comparison.indices))
    return hashlib.sha256(text.encode()).hexdigest()[:16]
