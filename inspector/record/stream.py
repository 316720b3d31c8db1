"""A stream of data to files and viewers, which is reproducible, needs bounded memory and is closed with a footer."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from datetime import timedelta
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from calibnet.errors import CalibnetError, ConfigError
from calibnet.runtime.memory import hand_back
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import naming
from inspector.record.flushing import RecordingLostError, flush
from inspector.record.indexing import NotIndexedError, index

FLUSH_BYTES = 1024 * 1024 * 1024
"""Size of a batch that is never reached, so that only flushes cut chunks."""

BEGINNING_BYTES = 1024 * 1024
"""More than a recording begins with, which is its name and its layout."""


class ViewerClosedError(CalibnetError):
    """The viewer that the recording went to has closed, and there is no file."""


class Stream:
    """A stream of Rerun that records equal data equally, and whose failures are errors with one sentence.

    Attributes:
        rec: Rerun's stream to log to. Only `flush` cuts chunks, and there is no wall-clock timeline.
        remark: a note for the user on how it was closed; empty for none.
    """

    def __init__(
        self, application_id: str, recording_id: str, title: str, sinks: Sequence[Any], blueprint: rrb.Blueprint
    ) -> None:
        """Connect the sinks and send title and blueprint.

        Args:
            application_id: application id; recordings with the same one share their layout in a viewer.
            recording_id: recording id, which is the same for the same data.
            title: title in the viewer's list of recordings.
            sinks: paths of files to write, and Rerun sinks, see `inspector.record.outputs`; if empty, everything goes
                to stdout.
            blueprint: the layout.

        Raises:
            ConfigError: a file cannot be written.
            OSError: likewise, as the disk is full.
        """
        rr.set_strict_mode(True)  # data that cannot be logged is an error, not a gap in the recording and a warning
        self.remark = ""
        self._sinks_gone = False
        self._files = [sink for sink in sinks if isinstance(sink, Path)]
        self._has_file = any(isinstance(sink, Path | rr.FileSink) for sink in sinks)
        self._identity, self._blueprint = (application_id, recording_id), blueprint
        with naming(self._files[0]) if self._files else nullcontext():
            self.rec = self._opened([_file_sink(sink) if isinstance(sink, Path) else sink for sink in sinks], True)
        self.rec.set_log_time_enabled(False)
        self.rec.send_recording_name(one_line(title))

    def _opened(self, sinks: Sequence[Any], is_new: bool) -> rr.RecordingStream:
        """Rerun's stream, which says of a new recording when it was begun; a whole one stands still when opened."""
        application_id, recording_id = self._identity
        batching = rr.ChunkBatcherConfig(flush_tick=timedelta(days=1), flush_num_bytes=FLUSH_BYTES)
        rec = rr.RecordingStream(
            application_id, recording_id=recording_id, batcher_config=batching, send_properties=is_new
        )
        whole = not (is_new and sinks)  # a file that is complete, or what Rerun's viewer imports
        if whole and hasattr(self._blueprint, "time_panel"):  # else a viewer plays it at once, to its last frame
            self._blueprint.time_panel.play_state = "Paused"
        with _passed_on(self._blueprint) as blueprint:
            if sinks:
                rec.set_sinks(*sinks, default_blueprint=blueprint)
            else:
                rec.stdout()
                rec.send_blueprint(blueprint)  # at once: the viewer has made a layout of its own for what it imports
        return rec

    def close(self, advance: Callable[[int, int], bool] | None = None) -> None:
        """Flush, and give the files their footers; does nothing if they can no longer be written.

        Args:
            advance: see `inspector.record.indexing.index`.
        """
        if self._sinks_gone:
            return
        self.flush()
        self.rec.disconnect()
        for file in self._files:
            try:
                index(file, lambda partial: self._opened([_file_sink(partial, footer=True)], False), advance)
            except NotIndexedError as error:
                self.remark = str(error)

    def flush(self) -> None:
        """Hand all rows to the sinks.

        Raises:
            RecordingLostError: the file's writer has failed, for instance because of a quota.
            ViewerClosedError: the viewer has closed and there is no file.
        """
        try:
            flush(self.rec)
        except RecordingLostError:
            self._sinks_gone = True
            raise
        except RuntimeError:
            if not self._has_file:
                self._sinks_gone = True
                raise ViewerClosedError(
                    "The viewer has closed the connection, so the run stopped; add --save to record to a file as well."
                ) from None


def plain(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with all text in UTF-8 and on one line, whatever the names of folders."""
    return {name: one_line(value) if isinstance(value, str) else value for name, value in options.items()}


def _file_sink(path: Path, footer: bool = False) -> rr.FileSink:
    """A file sink; that of a growing file has no footer.

    Rerun writes in a thread that fails silently, and then waits for it forever. Bytes that are written first, and taken
    back, show that the disk or a quota is full.
    """
    with path.open("wb", buffering=0) as file:
        left = BEGINNING_BYTES
        try:
            while left:
                left -= file.write(bytes(left))
        finally:
            file.truncate(0)
    try:
        return rr.FileSink(path, write_footer=footer)
    except (RuntimeError, ValueError) as error:  # a name that is no UTF-8, for one
        raise ConfigError(f"{path} cannot be written: {error}.") from None


@contextmanager
def _passed_on(blueprint: rrb.Blueprint) -> Iterator[rrb.Blueprint]:
    """A context with a blueprint for a call of Rerun, which keeps no data of it afterwards.

    Rerun 0.41 logs a blueprint to a memory stream that holds its data, which in turn hold the stream: every call costs
    two threads and some MB until the process ends, unless that stream is disconnected.
    """
    streams: list[rr.RecordingStream] = []
    log: Callable[[rr.RecordingStream], None] = blueprint._log_to_stream

    def log_and_note(stream: rr.RecordingStream) -> None:
        streams.append(stream)
        log(stream)

    blueprint._log_to_stream = log_and_note  # type: ignore[method-assign]
    try:
        yield blueprint
    finally:
        del blueprint._log_to_stream
        for stream in streams:
            stream.disconnect()


def release_closed() -> None:
    """Release threads and memory of closed streams, for processes that record repeatedly."""
    gc.collect()
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
    hand_back()
