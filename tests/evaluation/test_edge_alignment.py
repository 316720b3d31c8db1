from __future__ import annotations

import numpy as np

from calibnet.datasets import Frame
from calibnet.evaluation.edge_alignment import EdgeAlignment, discontinuities
from calibnet.geometry import MiscalibrationRange, PinholeCamera, depth_image, miscalibration, pose_error, transform

CAMERA = PinholeCamera(620, 200, np.array([[350.0, 0, 309.5], [0, 350.0, 99.5], [0, 0, 1]]))
REFERENCE = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.0, 0.0, 0.0])


def boxes() -> Frame:
    """Bright boxes before a dark wall, seen by a dense scanner at the camera's place."""
    v, u = np.mgrid[0:200:2, 0:620:2].reshape(2, -1)
    depth = np.full(u.shape, 30.0)
    image = np.zeros((200, 620, 3), np.uint8)
    for left, top, right, bottom, distance in ((60, 40, 160, 170, 8), (260, 70, 330, 190, 12), (440, 20, 560, 120, 6)):
        inside = (u >= left) & (u < right) & (v >= top) & (v < bottom)
        depth[inside] = distance
        image[top:bottom, left:right] = 255
    x, y = (u - 309.5) / 350 * depth, (v - 99.5) / 350 * depth
    points = np.stack([depth, -x, -y, np.zeros_like(depth)], axis=1).astype(np.float32)
    return Frame(0, 0.0, image, points, CAMERA, REFERENCE)


def test_points_before_a_drop_are_found_at_the_boxes_sides() -> None:
    frame = boxes()
    found = discontinuities(frame.points, REFERENCE, CAMERA)
    assert len(found) > 100 and (found[:, 0] < 15).all(), "the near side of an edge, not the wall"
    columns = np.nonzero(depth_image(found, REFERENCE, CAMERA))[1]
    sides = np.array([60, 160, 260, 330, 440, 560])
    assert np.abs(columns[:, None] - sides).min(axis=1).max() <= 6


def test_small_rotations_are_taken_back() -> None:
    left = []
    for seed in range(4):
        angles = np.random.default_rng(seed).uniform(-1.2, 1.2, 3)
        initial = miscalibration(angles, [0, 0, 0]) @ REFERENCE
        after = EdgeAlignment(MiscalibrationRange(2, 0.2)).calibrate(boxes(), initial).corrected
        left.append(pose_error(after, REFERENCE).rotation_deg / pose_error(initial, REFERENCE).rotation_deg)
    assert np.mean(left) < 0.35


def test_a_scan_without_edges_stays_where_it_is() -> None:
    away = miscalibration([0, 0, 120], [0, 0, 0]) @ REFERENCE
    np.testing.assert_array_equal(EdgeAlignment(MiscalibrationRange(2, 0.2)).calibrate(boxes(), away).corrected, away)
