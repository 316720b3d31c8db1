"""The rectified pinhole camera. Pixel centres are at integer coordinates, as in OpenCV and KITTI."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from calibnet.geometry.types import Intrinsics


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """Image size in pixels and the 3x3 intrinsic matrix of a rectified camera."""

    width: int
    height: int
    matrix: Intrinsics = field(repr=False)

    @property
    def focal(self) -> tuple[float, float]:
        """Focal lengths ``(fx, fy)`` in pixels."""
        return float(self.matrix[0, 0]), float(self.matrix[1, 1])

    @property
    def center(self) -> tuple[float, float]:
        """Principal point ``(cx, cy)`` in pixels."""
        return float(self.matrix[0, 2]), float(self.matrix[1, 2])

    def is_like(self, other: PinholeCamera) -> bool:
        """Whether another camera has the same image size and intrinsics."""
        return (self.width, self.height) == (other.width, other.height) and np.allclose(self.matrix, other.matrix)

    def resized(self, width: int, height: int) -> PinholeCamera:
        """The camera of the image resized to ``width`` x ``height``.

        With pixel centres at integers, ``u' + 0.5 = s (u + 0.5)``: the half pixel matters at 1/8.
        """
        sx, sy = width / self.width, height / self.height
        scale = np.array([[sx, 0.0, 0.5 * sx - 0.5], [0.0, sy, 0.5 * sy - 0.5], [0.0, 0.0, 1.0]])
        return PinholeCamera(width, height, scale @ self.matrix)

    def fitted(self, height: float, width: float, multiple: int) -> PinholeCamera:
        """The camera of the image resized to the area of ``height`` x ``width`` pixels at its own aspect ratio.

        Both sides are rounded to multiples of ``multiple`` (the coarsest stride of a network), so the two focal
        lengths may scale by slightly different factors.
        """
        scale = (height * width / (self.height * self.width)) ** 0.5
        rows = max(1, round(self.height * scale / multiple)) * multiple
        columns = max(1, round(self.width * scale / multiple)) * multiple
        return self.resized(columns, rows)
