"""How the estimate of a drive converges: the curve of what more and more frames say."""

from __future__ import annotations

from collections.abc import Callable

from calibnet.datasets.selection import evenly_spaced
from calibnet.trace import Estimate

POINTS = 12
"""Most points of the curve."""


class Due:
    """Positions of a drive at which something is to be done, ticked off as the drive goes on."""

    def __init__(self, positions: list[int]) -> None:
        """Wait for ``positions``, which are sorted."""
        self._left = list(positions)

    def reached(self, position: int) -> bool:
        """Whether one is reached, as positions grow; it is done then, with all before it.

        A frame that fails is made up for by the next one that does not.
        """
        reached = bool(self._left) and self._left[0] <= position
        while self._left and self._left[0] <= position:
            self._left.pop(0)
        return reached


class Convergence:
    """The curve; its last point is the estimate of all frames."""

    def __init__(self, frames: int) -> None:
        """Begin the curve of a drive of ``frames`` frames."""
        self.points: list[tuple[int, Estimate]] = []
        self._due = Due(evenly_spaced(frames, POINTS)[:-1])
        self._frame = 0

    @property
    def latest(self) -> list[Estimate]:
        """The estimate at the last point, from which the next one starts; none at first."""
        return [estimate for _, estimate in self.points[-1:]]

    def note(self, position: int, frame: int, estimate: Callable[[], Estimate]) -> None:
        """Take in the frame of this index, at this position of the drive; make a point there if one is due."""
        self._frame = frame
        if self._due.reached(position):
            self.points.append((frame, estimate()))

    def end(self, estimate: Estimate) -> None:
        """Make the estimate of all frames the last point, at the last frame that was taken in."""
        if self.points and self.points[-1][0] == self._frame:
            self.points.pop()
        self.points.append((self._frame, estimate))
