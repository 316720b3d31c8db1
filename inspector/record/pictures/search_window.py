"""The search window of one LiDAR cell: its scores, and the initial, the found and the true position of the point."""

from __future__ import annotations

import numpy as np
import rerun as rr

from calibnet.trace import ScaleTrace
from inspector import colors
from inspector.record.pictures.matches import Match

CELL_FRAME: colors.Rgb = (255, 0, 200)


class SearchWindow:
    """The window of a cost volume in which one match is searched, in cells, with the cell itself at the centre."""

    def __init__(self, scale: ScaleTrace, match: Match) -> None:
        """Extract the window of the match's cell from the volume."""
        height, width = scale.occupied.shape
        x, y = match.cell(scale.stride)
        self._cell = min(x, width - 1), min(y, height - 1)
        x, y = self._cell
        self._scores = scale.volume[:, :, y, x].astype(np.float32)
        down, across = self._scores.shape
        rows, columns = np.arange(down)[:, None] - down // 2 + y, np.arange(across) - across // 2 + x
        self._inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        self._found = scale.best[y, x]
        self._true = None if match.true_displacement is None else np.asarray(match.true_displacement) / scale.stride
        self._middle = np.array([self._scores.shape[1] // 2, self._scores.shape[0] // 2]) + 0.5

    def scores(self) -> rr.Image:
        """The matching scores, dark to bright over the window's own range; without colour outside the image."""
        seen = self._scores[self._inside]
        picture = colors.map_colors(self._scores, float(seen.min()), float(seen.max()))
        picture[~self._inside] = colors.GROUND
        return rr.Image(picture)

    def cells(self) -> rr.Boxes2D:
        """Frames in the window around the cell where the point is now and the one where it was found."""
        return rr.Boxes2D(
            centers=[self._middle, self._middle + self._found],
            half_sizes=[[0.5, 0.5], [0.4, 0.4]],
            colors=[colors.INITIAL, colors.FOUND],
            radii=rr.Radius.ui_points(1.5),
        )

    def truth(self) -> rr.Points2D | None:
        """The true position of the point, on the window's border if it is outside; None without a reference."""
        if self._true is None:
            return None
        height, width = self._scores.shape
        at_border = np.clip(self._middle + self._true, 0.0, [width, height])
        return rr.Points2D([at_border], colors=colors.REFERENCE, radii=rr.Radius.ui_points(5.0))

    def frame(self) -> rr.Boxes2D:
        """A frame on the maps around the cell whose window this is."""
        return rr.Boxes2D(mins=[self._cell], sizes=[[1, 1]], colors=CELL_FRAME, radii=rr.Radius.ui_points(1.5))
