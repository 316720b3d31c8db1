"""The convergence of a drive's estimate with the number of frames."""

from __future__ import annotations

from collections.abc import Callable

from calibnet.datasets.selection import evenly_spaced
from calibnet.trace import Estimate

POINTS = 12
"""Largest number of points of the curve."""


class Due:
    """Positions of a drive at which something is due, crossed off as the drive goes on."""

    def __init__(self, positions: list[int]) -> None:
        """Wait for ``positions``, which are sorted."""
        self._left = list(positions)

    def reached(self, position: int) -> bool:
        """Whether a due position is reached; it and all before it are then crossed off.

        If a frame fails, the next good one takes its place.
        """
        reached = bool(self._left) and self._left[0] <= position
        while self._left and self._left[0] <= position:
            self._left.pop(0)
        return reached


class Convergence:
    """The curve of estimates, whose last point is that of all frames."""

    def __init__(self, frames: int) -> None:
        """Begin the curve of a drive of ``frames`` frames."""
        self.points: list[tuple[int, Estimate]] = []
        self._due = Due(evenly_spaced(frames, POINTS)[:-1])
        self._frame = 0

    @property
    def latest(self) -> list[Estimate]:
        """The estimate at the last point, from which the next one starts; empty at first."""
        return [estimate for _, estimate in self.points[-1:]]

    def note(self, position: int, frame: int, estimate: Callable[[], Estimate]) -> None:
        """Note a frame and its position in the drive, and add a point if one is due."""
        self._frame = frame
        if self._due.reached(position):
            self.points.append((frame, estimate()))

    def end(self, estimate: Estimate) -> None:
        """Add the estimate of all frames as the last point, at the last frame noted."""
        if self.points and self.points[-1][0] == self._frame:
            self.points.pop()
        self.points.append((self._frame, estimate))
