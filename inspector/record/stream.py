"""A stream of data to files and viewers: the same for the same calls, in bounded memory, closed with a footer."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from calibnet.errors import CalibnetError, ConfigError
from calibnet.runtime.memory import hand_back
from calibnet.runtime.text import one_line
from inspector.record.flushing import RecordingLostError, flush
from inspector.record.indexing import NotIndexedError, index

FLUSH_BYTES = 1024 * 1024 * 1024
"""Above any batch, so that only the flushes cut chunks."""


class ViewerClosedError(CalibnetError):
    """The viewer that the recording went to has closed, and there is no file to go on with."""


class Stream:
    """A stream of Rerun's whose recordings are equal for equal data, and whose failures are errors with one sentence.

    Attributes:
        rec: what to log to. Chunks are cut by `flush` alone, and there is no wall-clock timeline.
        remark: what a user has to know about how it was closed; empty for nothing.
    """

    def __init__(
        self, application_id: str, recording_id: str, title: str, sinks: Sequence[Any], blueprint: rrb.Blueprint
    ) -> None:
        """Connect the sinks and send what viewers show first.

        Args:
            application_id: recordings with the same one share their layout in a viewer.
            recording_id: the same for the same data.
            title: for the viewer's list of recordings.
            sinks: paths of files to write, and Rerun sinks, see `inspector.record.outputs`; without any, everything
                goes to stdout.
            blueprint: the layout.

        Raises:
            ConfigError: a file cannot be written.
        """
        rr.set_strict_mode(True)  # what cannot be logged must be an error, not a gap in the recording and a warning
        self.remark = ""
        self._sinks_gone = False
        self._files = [sink for sink in sinks if isinstance(sink, Path)]
        self._has_file = any(isinstance(sink, Path | rr.FileSink) for sink in sinks)
        self._identity, self._blueprint = (application_id, recording_id), blueprint
        self.rec = self._opened([_growing(sink) if isinstance(sink, Path) else sink for sink in sinks], True)
        self.rec.set_log_time_enabled(False)
        self.rec.send_recording_name(one_line(title))

    def _opened(self, sinks: Sequence[Any], is_new: bool) -> rr.RecordingStream:
        """Rerun's stream, which says of a new recording when it was begun; a whole one stands still when opened."""
        application_id, recording_id = self._identity
        batching = rr.ChunkBatcherConfig(flush_tick=timedelta(days=1), flush_num_bytes=FLUSH_BYTES)
        rec = rr.RecordingStream(
            application_id, recording_id=recording_id, batcher_config=batching, send_properties=is_new
        )
        if not is_new and hasattr(self._blueprint, "time_panel"):  # else a viewer plays it at once, to its last frame
            self._blueprint.time_panel.play_state = "Paused"
        with _passed_on(self._blueprint) as blueprint:
            if sinks:
                rec.set_sinks(*sinks, default_blueprint=blueprint)
            else:
                rec.stdout(default_blueprint=blueprint)
        return rec

    def close(self, advance: Callable[[int, int], bool] | None = None) -> None:
        """Flush, and give the files their footers; nothing, where nothing can be written any more.

        Args:
            advance: see `inspector.record.indexing.index`.
        """
        if self._sinks_gone:
            return
        self.flush()
        self.rec.disconnect()
        for file in self._files:
            try:
                index(file, lambda partial: self._opened([rr.FileSink(partial)], False), advance)
            except NotIndexedError as error:
                self.remark = str(error)

    def flush(self) -> None:
        """Hand all rows to the sinks.

        Raises:
            RecordingLostError: the file's writer has given up, for instance on a quota.
            ViewerClosedError: the viewer has gone and there is no file.
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
                    "The viewer has closed the connection, and there is no --save to go on with."
                ) from None


def plain(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with text that is in UTF-8 and one line, whatever a folder is called."""
    return {name: one_line(value) if isinstance(value, str) else value for name, value in options.items()}


def _growing(path: Path) -> rr.FileSink:
    """A file that is written while it has no footer."""
    try:
        return rr.FileSink(path, write_footer=False)
    except (RuntimeError, ValueError) as error:  # a name that is no UTF-8, for one
        raise ConfigError(f"{path} cannot be written: {error}.") from None


@contextmanager
def _passed_on(blueprint: rrb.Blueprint) -> Iterator[rrb.Blueprint]:
    """A blueprint for a call of Rerun's, which keeps nothing of it after the block.

    Rerun 0.41 logs it to a stream in memory of its own, which holds its data, which hold the stream: two threads and
    some MB for every call until the process ends, unless that stream is disconnected.
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
    """Let go of the threads and the memory of streams that are closed; for processes that record again and again."""
    gc.collect()
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
    hand_back()
