"""Flushes a recording to its files and viewers, which may no longer accept it."""

from __future__ import annotations

import rerun as rr

from calibnet.errors import CalibnetError

FLUSH_TIMEOUT_S = 60.0


class RecordingLostError(CalibnetError):
    """The recording can no longer be written; Rerun would wait for ever, even at the end of the process."""


def flush(rec: rr.RecordingStream) -> None:
    """Flush all rows to the sinks.

    Raises:
        RecordingLostError: the file's writer has failed, for instance because of a quota.
        RuntimeError: a viewer has closed.
    """
    try:
        rec.flush(timeout_sec=FLUSH_TIMEOUT_S)
    except RuntimeError as error:
        if "timed out" not in str(error):
            raise
        raise RecordingLostError(
            "The recording can no longer be written: the disk or a quota is full, or a viewer does not respond."
        ) from None
