from __future__ import annotations

import pytest

from calibnet.errors import CalibrationError
from calibnet.geometry import MiscalibrationRange, miscalibration, pose_error
from calibnet.methods.information_distance import InformationDistance
from tests.support.boxes import REFERENCE, boxes


def test_reflectance_that_is_the_brightness_gives_the_pose() -> None:
    initial = miscalibration([1.2, -1.0, 1.1], [0.1, 0.1, -0.1]) @ REFERENCE
    trace = InformationDistance(MiscalibrationRange(2, 0.2)).calibrate(boxes(), initial, detail=True)
    left = pose_error(trace.corrected, REFERENCE)
    assert left.rotation_deg < 0.2 and left.translation_cm < 5
    (curve,) = trace.stages[0].curves
    assert len(curve.values) == 20 and curve.values[0] < curve.values[-1]  # not every start comes down as far


def test_a_scan_without_reflectance_is_refused() -> None:
    with pytest.raises(CalibrationError, match="too few points with reflectance"):
        InformationDistance(MiscalibrationRange(2, 0.2)).calibrate(boxes(reflectance=False), REFERENCE)
