"""A stream of data to files and viewers: the same for the same calls, in bounded memory, closed with a footer."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from calibnet.errors import CalibnetError

FLUSH_TIMEOUT_S = 60.0
FLUSH_BYTES = 1024 * 1024 * 1024
"""Above any batch, so that only the flushes cut chunks."""


class RecordingLostError(CalibnetError):
    """Nothing can be written any more; Rerun would wait for it for ever, even when the process ends."""


class ViewerClosedError(CalibnetError):
    """The viewer that the recording went to has closed, and there is no file to go on with."""


class Stream:
    """A stream of Rerun's whose recordings are equal for equal data, and whose failures are errors with one sentence.

    Attributes:
        rec: what to log to. Chunks are cut by `flush` alone, and there is no wall-clock timeline.
    """

    def __init__(
        self, application_id: str, recording_id: str, title: str, sinks: Sequence[Any], blueprint: rrb.Blueprint
    ) -> None:
        """Connect the sinks and send what viewers show first.

        Args:
            application_id: recordings with the same one share their layout in a viewer.
            recording_id: the same for the same data.
            title: for the viewer's list of recordings.
            sinks: Rerun sinks, see `inspector.record.outputs`; without any, everything goes to stdout.
            blueprint: the layout.
        """
        rr.set_strict_mode(True)  # what cannot be logged must be an error, not a gap in the recording and a warning
        self._sinks_gone = False
        self._has_file = any(isinstance(sink, rr.FileSink) for sink in sinks)
        self.rec = rr.RecordingStream(
            application_id,
            recording_id=recording_id,
            batcher_config=rr.ChunkBatcherConfig(flush_tick=timedelta(days=1), flush_num_bytes=FLUSH_BYTES),
        )
        if sinks:
            self.rec.set_sinks(*sinks, default_blueprint=blueprint)
        else:
            self.rec.stdout(default_blueprint=blueprint)
        self.rec.set_log_time_enabled(False)
        self.rec.send_recording_name(title)

    def close(self) -> None:
        """Flush and write the footer; nothing, where nothing can be written any more."""
        if self._sinks_gone:
            return
        self.flush()
        self.rec.disconnect()

    def flush(self) -> None:
        """Hand all rows to the sinks.

        Raises:
            RecordingLostError: the file's writer has given up, for instance on a quota.
            ViewerClosedError: the viewer has gone and there is no file.
        """
        try:
            self.rec.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            self._sinks_gone = "timed out" in str(error) or not self._has_file
            if "timed out" in str(error):
                raise RecordingLostError(
                    "The recording can no longer be written: the disk or a quota is full, or a viewer does not respond."
                ) from None
            if not self._has_file:
                raise ViewerClosedError(
                    "The viewer has closed the connection, and there is no --save to go on with."
                ) from None
