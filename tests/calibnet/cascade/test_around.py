"""What every stage does around its network: what is said where that cannot be done, and how far a correction goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from calibnet.cascade.around import extended, projected
from calibnet.errors import CalibrationError
from calibnet.geometry import miscalibration, rotation_angle
from tests.support.scene import REFERENCE, make_frame

FRAME = make_frame(1)


def test_too_few_points_name_frame_and_stage() -> None:
    sparse = replace(FRAME, points=FRAME.points[:5])
    with pytest.raises(CalibrationError, match=r"^Hardly any of the 5 LiDAR points of frame .* before stage 4; check"):
        projected(sparse, REFERENCE, FRAME.camera, (8, 16), "stage 4")
    assert projected(FRAME, REFERENCE, FRAME.camera, (8, 16), "stage 4").occupied.sum() > 20


def test_a_correction_that_is_not_finite_is_a_sentence() -> None:
    estimate = torch.full((4, 4), float("nan"))
    with pytest.raises(CalibrationError, match=r"^The correction of frame \d+ \(.*\) by stage 4 is not finite; train"):
        extended(estimate, 1.0, FRAME, "stage 4")


def test_a_correction_is_rigid_and_goes_as_far_as_the_gain_says() -> None:
    delta = miscalibration([2.0, 0.0, 0.0], [0.1, 0.0, 0.2])
    correction = extended(torch.from_numpy(delta.astype(np.float32)), 1.5, FRAME, "stage 4")
    np.testing.assert_allclose(correction[:3, 3], [0.15, 0.0, 0.3], atol=1e-7)
    assert np.degrees(rotation_angle(correction[:3, :3])) == pytest.approx(3.0, abs=1e-5)
    np.testing.assert_allclose(correction[:3, :3] @ correction[:3, :3].T, np.eye(3), atol=1e-12)
