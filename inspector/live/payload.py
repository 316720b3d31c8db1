"""The data of a frame with which the page draws it by itself, so that points follow the sliders without a request."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from inspector import colors
from inspector.record.pictures.painting import depth_edges

JPEG_QUALITY = 90
MOST_POINTS = 150_000
"""Largest number of points, which a page draws within a few milliseconds."""


def picture_jpeg(frame: Frame) -> bytes:
    """The rectified image, whose camera is a pinhole."""
    done, encoded = cv2.imencode(".jpg", frame.image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert done, "a picture that was read can be encoded"
    return encoded.tobytes()


def points_bytes(frame: Frame) -> bytes:
    """The scan: ``N`` as uint32, then ``[N, 3]`` float32 metres, then ``[N]`` uint8 intensity, then ``[N]`` uint8 edge.

    Intensity is stretched to 0..255 between robust limits; edge is 1 at depth edges.
    """
    points, intensity, edge = points_to_draw(frame)
    parts = [np.array([len(points)], np.uint32), points.astype(np.float32), intensity, edge]
    return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)


def points_to_draw(frame: Frame) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.uint8]]:
    """Positions, intensities and edges of every point, or of every n-th point of a huge cloud."""
    every = -(-len(frame.points) // MOST_POINTS)
    points = frame.points[::every]
    low, high = colors.robust_limits(points[:, 3])
    level = np.clip((points[:, 3] - low) / max(high - low, 1e-6), 0.0, 1.0)
    return points[:, :3], np.round(255 * level).astype(np.uint8), depth_edges(frame.points)[::every].astype(np.uint8)


def palettes() -> dict[str, object]:
    """The colours of recordings, for the page to use as well."""
    return {
        "turbo": colors.TURBO.ravel().tolist(),
        "viridis": colors.VIRIDIS.ravel().tolist(),
        "near": colors.NEAR_M,
        "far": colors.FAR_M,
        "edge": colors.EDGE,
        "rest": colors.REST,
        "worst": colors.WORST_PX,
    }
