"""The weights in the package, on real frames of a car and a lens they were never trained on."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibnet.cascade.cascade import Cascade
from calibnet.datasets import open_sequence
from calibnet.evaluation.runner import evaluate_frames
from calibnet.geometry import MiscalibrationRange

ODOMETRY = Path(__file__).parents[3] / "shared" / "kitti" / "odometry"


@pytest.mark.skipif(not ODOMETRY.is_dir(), reason="../shared/kitti/odometry is not there")
def test_rotation_errors_shrink_on_a_rig_never_trained_on() -> None:
    sequence = open_sequence("kitti-odometry", ODOMETRY, sequence="04")
    range_ = MiscalibrationRange(5, 0.5)
    evaluation = evaluate_frames(Cascade.load("compact", (3, 4, 5)), [sequence], range_, repeats=2, seed=7)
    before, after = evaluation.initial.as_dict(), evaluation.stages[-1].metrics.as_dict()
    assert evaluation.failed == 0
    assert after["rotation_deg"]["median"] < 0.85 * before["rotation_deg"]["median"]
