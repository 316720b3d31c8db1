"""Counts readings of frames, for progress."""

from __future__ import annotations

from collections.abc import Callable

from calibnet.datasets.frame import Frame, Frames, index_of


class Readings:
    """Tells an observer, if any, the number of frames read and the total."""

    def __init__(self, observer: Callable[[int, int], None] | None, total: int) -> None:
        """Start counting ``total`` readings."""
        self.observer, self.total, self.done = observer, total, 0

    def one_more(self) -> None:
        """Note that a frame is about to be read."""
        self._tell()
        self.done += 1

    def end(self) -> None:
        """Note that all frames are read and processed."""
        self.done = self.total
        self._tell()

    def _tell(self) -> None:
        if self.observer is not None:
            self.observer(self.done, self.total)


class Observed:
    """Frames whose readings are counted."""

    def __init__(self, frames: Frames, readings: Readings) -> None:
        self.frames, self.readings = frames, readings

    def __len__(self) -> int:
        return len(self.frames)

    def index_of(self, position: int) -> int:
        """The number of a frame."""
        return index_of(self.frames, position)

    def __getitem__(self, position: int, /) -> Frame:
        """Read one frame."""
        self.readings.one_more()
        return self.frames[position]
