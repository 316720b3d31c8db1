"""Bright boxes before a dark, striped wall, seen by a dense scanner at the camera's place."""

from __future__ import annotations

import numpy as np

from calibnet.datasets import Frame
from calibnet.geometry import PinholeCamera, transform

CAMERA = PinholeCamera(1024, 320, np.array([[580.0, 0, 511.5], [0, 580.0, 159.5], [0, 0, 1]]))
REFERENCE = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.0, 0.0, 0.0])
BOXES = ((100, 60, 260, 270, 8), (430, 110, 550, 300, 12), (720, 30, 930, 200, 6))
"""Left, top, right, bottom in pixels, and metres."""


def boxes(depth_edges: bool = True, reflectance: bool = True, picture: bool = True) -> Frame:
    """The scene as a frame, without some of what tells its extrinsic."""
    grid = np.mgrid[1:320:2, 1:1024:2]
    v, u = grid.reshape(2, -1)
    depth, stripe = np.full(u.shape, 30.0), (u // 64 + v // 64) % 2
    image = np.full((320, 1024, 3), 100, np.uint8)
    rows, columns = np.mgrid[0:320, 0:1024]
    bright = 0.2 + 0.3 * stripe
    image[(columns // 64 + rows // 64) % 2 == 1] = 160
    for left, top, right, bottom, distance in BOXES:
        inside = (u >= left) & (u < right) & (v >= top) & (v < bottom)
        depth[inside], bright[inside] = distance if depth_edges else 30.0, 0.9
        image[top:bottom, left:right] = 250
    x, y = (u - 511.5) / 580 * depth, (v - 159.5) / 580 * depth
    intensity = bright if reflectance else np.zeros_like(depth)
    points = np.stack([depth, -x, -y, intensity], axis=1).astype(np.float32)
    return Frame(0, 0.0, image if picture else np.full_like(image, 128), points, CAMERA, REFERENCE)
