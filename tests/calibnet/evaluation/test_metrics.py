from __future__ import annotations

import json
import statistics

import numpy as np
import pytest

from calibnet.evaluation.metrics import Metrics
from calibnet.geometry import PoseError, miscalibration, pose_error


def error(rotation: float = 0.0, translation: float = 0.0, **axes: float) -> PoseError:
    values = dict.fromkeys(("roll_deg", "pitch_deg", "yaw_deg", "x_cm", "y_cm", "z_cm"), 0.0) | axes
    return PoseError(rotation_deg=rotation, translation_cm=translation, **values)


def test_axes_are_averaged_over_every_frame() -> None:
    """Published code averages over the first three frames; frames 4 to 7 make the difference here."""
    errors = [error(roll_deg=r, x_cm=x) for r, x in [(1, 0), (-1, 0), (1, 0), (9, 7), (-9, -7), (9, 7), (-9, 7)]]
    metrics = Metrics.of(errors)
    assert metrics.rotation_deg.roll == pytest.approx((3 * 1 + 4 * 9) / 7)
    assert metrics.translation_cm.x == pytest.approx(4 * 7 / 7)
    assert metrics.rotation_deg.pitch == metrics.rotation_deg.yaw == 0.0
    assert metrics.translation_cm.y == metrics.translation_cm.z == 0.0


def test_signs_do_not_cancel() -> None:
    metrics = Metrics.of([error(yaw_deg=2.0, z_cm=-3.0), error(yaw_deg=-2.0, z_cm=3.0)])
    assert (metrics.rotation_deg.yaw, metrics.translation_cm.z) == (2.0, 3.0)


def test_each_axis_lands_in_its_own_column() -> None:
    delta = miscalibration([1.0, 0.0, 0.0], [0.0, 0.02, 0.0])  # roll, and y
    metrics = Metrics.of([pose_error(delta, np.eye(4))] * 4)
    assert metrics.rotation_deg.roll == pytest.approx(1.0)
    assert metrics.rotation_deg.pitch == pytest.approx(0.0, abs=1e-9)
    assert metrics.rotation_deg.yaw == pytest.approx(0.0, abs=1e-9)
    assert (metrics.translation_cm.x, metrics.translation_cm.z) == (0.0, 0.0)
    assert metrics.translation_cm.y == pytest.approx(2.0)


def test_distribution_agrees_with_the_standard_library() -> None:
    angles = [0.3, 4.0, 1.1, 0.7, 2.9]
    metrics = Metrics.of([error(rotation=a, translation=10 * a) for a in angles])
    assert metrics.rotation_deg.mean == pytest.approx(statistics.fmean(angles))
    assert metrics.rotation_deg.median == statistics.median(angles)
    assert metrics.rotation_deg.std == pytest.approx(statistics.pstdev(angles))
    # 95 % of the way through five sorted values: 0.8 of the last step
    assert metrics.rotation_deg.p95 == pytest.approx(2.9 + 0.8 * (4.0 - 2.9))
    assert metrics.translation_cm.mean == pytest.approx(10 * statistics.fmean(angles))


def test_success_needs_both_and_is_strict() -> None:
    metrics = Metrics.of(
        [
            error(0.5, 1.0),  # passes both
            error(1.5, 4.0),  # passes the wide one
            error(0.5, 6.0),  # too far
            error(3.0, 1.0),  # turned too much
            error(2.0, 4.0),  # on the bound: not below it
        ]
    )
    assert metrics.success_2deg_5cm == pytest.approx(2 / 5)
    assert metrics.success_1deg_2_5cm == pytest.approx(1 / 5)


def test_as_dict_has_the_documented_keys_and_survives_json() -> None:
    content = Metrics.of([error(1.0, 2.0, roll_deg=-1.0), error(3.0, 4.0)]).as_dict()
    assert json.loads(json.dumps(content)) == {
        "rotation_deg": {"mean": 2.0, "median": 2.0, "std": 1.0, "p95": 2.9, "roll": 0.5, "pitch": 0.0, "yaw": 0.0},
        "translation_cm": {"mean": 3.0, "median": 3.0, "std": 1.0, "p95": 3.9, "x": 0.0, "y": 0.0, "z": 0.0},
        "success_2deg_5cm": 0.5,
        "success_1deg_2.5cm": 0.0,
    }


def test_no_frames_have_no_metrics() -> None:
    with pytest.raises(ValueError, match="no errors"):
        Metrics.of([])
