"""Records every try for the viewer on one timeline, ``try``: ``number * 8 + stage``, as `entities.STEP` does frames.

The page's viewer gets pieces of an ``.rrd``, each complete in itself, over the page's own guarded connection, so that
no other port is open. All pieces are kept in a file for windows that open later.
"""

from __future__ import annotations

import tempfile
import threading
import uuid
from datetime import timedelta

import rerun as rr

from inspector import entities
from inspector.live import matches
from inspector.live.tries import Try
from inspector.record.contents import Contents, Part
from inspector.record.frame import log_frame
from inspector.record.observation import Layout, Observation
from inspector.record.subtree import Subtree
from inspector.record.tabs import cascade, cost_volumes, exhibits, hourglass, scene
from inspector.record.tabs.blueprint import make_blueprint
from inspector.record.tabs.cost_volumes import log_windows
from inspector.record.tabs.registry import Tab

TIMELINE = "try"
APPLICATION_ID = "calib-inspect-live"
TABS: tuple[Tab, ...] = (matches, cost_volumes, cascade, exhibits, scene, hourglass)
"""Tabs of the viewer beside the page, which has its own overview; the first one answers a click."""
CONTENTS = Contents(frozenset({Part.OVERLAYS, Part.VOLUMES, Part.HOURGLASS, Part.SCENE}), dense=True)


class TrySubtree(Subtree):
    """Logs a frame at the number of its try instead of its own."""

    number = 0

    def set_frame(self, index: int, seconds: float) -> None:
        """Set the timeline to the try, before its first stage."""
        self.set_step(index, 0)

    def set_step(self, index: int, stage: int) -> None:
        """Set the timeline to a stage of the try; 0 is before the first."""
        self._stream.set_time(TIMELINE, sequence=self.number * entities.STEPS_PER_FRAME + stage)


class TryRecording:
    """The recording of a live session; subclasses decide where it goes."""

    def __init__(self, tabs: tuple[Tab, ...] = TABS) -> None:
        """Open an empty recording.

        Args:
            tabs: tabs to show if there is data for them.
        """
        rr.set_strict_mode(True)
        whole = rr.ChunkBatcherConfig(
            flush_tick=timedelta(days=1)
        )  # few chunks, since a viewer takes only some per picture
        self._stream = rr.RecordingStream(APPLICATION_ID, recording_id=uuid.uuid4().hex, batcher_config=whole)
        self._stream.set_log_time_enabled(False)
        self._rec = TrySubtree(self._stream)
        self._all_tabs, self._tabs = tabs, list[Tab]()

    def answer(self, made: Try, observation: Observation) -> None:
        """Show the result of a try before its details; does nothing where a page shows it."""

    def log(self, made: Try, observation: Observation) -> None:
        """Log a try on one frame with its details."""
        if not self._tabs:
            self._open(Layout.of(observation, CONTENTS))
        self._rec.number = made.number
        log_frame(self._rec, observation, CONTENTS)
        for tab in self._tabs:
            tab.log(self._rec, observation, CONTENTS)
        self._keep()

    def log_point(self, made: Try, observation: Observation, point: int) -> None:
        """Move the search windows of a try to a point of the scan, by its row."""
        self._rec.number = made.number
        self._rec.set_frame(observation.frame.index, 0.0)
        log_windows(self._rec, observation, CONTENTS, point)
        self._keep()

    def _open(self, layout: Layout) -> None:
        self._tabs = [tab for tab in self._all_tabs if tab.wanted(layout)]
        # first of all, or a slow viewer would show every legend in a view of its own
        self._stream.send_blueprint(make_blueprint(layout, self._tabs, timeline=TIMELINE, following=True))
        self._stream.send_recording_name("live")
        for tab in self._tabs:
            tab.log_once(self._rec, layout)

    def _keep(self) -> None:
        """Pass on what was logged."""
        raise NotImplementedError

    def close(self) -> None:
        """Delete the recording."""
        self._stream.disconnect()


class TryStream(TryRecording):
    """A recording in pieces, for the page."""

    def __init__(self) -> None:
        """Open an empty recording."""
        super().__init__()
        self._bytes = rr.binary_stream(self._stream)
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the stream
        self._pieces: list[tuple[int, int]] = []
        self._lock = threading.Lock()

    def _keep(self) -> None:
        piece = self._bytes.read() or b""
        with self._lock:
            start = self._file.seek(0, 2)
            self._file.write(piece)
            self._pieces.append((start, len(piece)))

    def __len__(self) -> int:
        return len(self._pieces)

    def piece(self, number: int) -> bytes:
        """The piece of a number."""
        with self._lock:
            start, length = self._pieces[number]
            self._file.seek(start)
            return self._file.read(length)

    def close(self) -> None:
        """Delete the recording."""
        self._bytes.read()  # Rerun would warn of unread data
        super().close()
        self._file.close()
