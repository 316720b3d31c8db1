from __future__ import annotations

import numpy as np

from calibnet.geometry import MiscalibrationRange, miscalibration, pose_error
from calibnet.methods.edge_alignment import EdgeAlignment
from tests.support.boxes import REFERENCE, boxes


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
