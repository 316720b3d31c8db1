"""Turns Ctrl-C and SIGTERM into a request to stop between two frames or steps, so that nothing ends half done."""

from __future__ import annotations

import signal
import sys
import threading
import time
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopRequest:
    """A context in which the first signal requests a stop and the second raises KeyboardInterrupt."""

    def __init__(self, acknowledgement: str = "") -> None:
        """Prepare; ``acknowledgement`` is printed at the first signal."""
        self.requested = False
        self._acknowledgement = acknowledgement
        self._previous: dict[signal.Signals, Any] = {}

    def __enter__(self) -> StopRequest:
        # Python allows handlers in the main thread only; elsewhere signals keep their meaning.
        if threading.current_thread() is threading.main_thread():
            self._previous = {number: signal.signal(number, self._handle) for number in SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def wait(self) -> None:
        """Return once a stop is requested."""
        while not self.requested:
            time.sleep(0.1)

    def _handle(self, number: int, _: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
        if self._acknowledgement:
            sys.stderr.write(f"\n{self._acknowledgement}\n")
