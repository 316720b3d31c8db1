"""Handing everything that was logged to the files and viewers, which may have ceased to take it."""

from __future__ import annotations

import rerun as rr

from calibnet.errors import CalibnetError

FLUSH_TIMEOUT_S = 60.0


class RecordingLostError(CalibnetError):
    """Nothing can be written any more; Rerun would wait for it for ever, even when the process ends."""


def flush(rec: rr.RecordingStream) -> None:
    """Hand all rows to the sinks.

    Raises:
        RecordingLostError: the file's writer has given up, for instance on a quota.
        RuntimeError: a viewer has gone.
    """
    try:
        rec.flush(timeout_sec=FLUSH_TIMEOUT_S)
    except RuntimeError as error:
        if "timed out" not in str(error):
            raise
        raise RecordingLostError(
            "The recording can no longer be written: the disk or a quota is full, or a viewer does not respond."
        ) from None
