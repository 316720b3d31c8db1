"""Calibrations under what is known beforehand: frame by frame, and as one drive."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.cascade import Cascade, Stage
from calibnet.cascade.stage import with_prior
from calibnet.datasets.frame import Frame
from calibnet.geometry import RANGES, euler_xyz, invert, miscalibration, pose_error
from calibnet.geometry.prior import AXES, Prior
from calibnet.geometry.types import Extrinsic
from calibnet.judging.coefficients import Coefficients
from calibnet.judging.covariance import CovarianceModel
from calibnet.trace import StageTrace
from tests.support.drive import CAMERA
from tests.support.scene import REFERENCE, make_frame
from tests.support.tiny import tiny_network

INITIAL = miscalibration([2.0, -1.0, 3.0], [0.2, -0.1, 0.3]) @ REFERENCE


@pytest.fixture(scope="module")
def frame() -> Frame:
    return make_frame(3)


def cascade(prior: Prior) -> Cascade:
    """Random networks, which want to move everything."""
    stages = [Stage(number, RANGES[number - 1], tiny_network(seed=number, stage=number)) for number in (4, 5)]
    return Cascade(stages, prior=prior)


def moved(after: Extrinsic) -> dict[str, float]:
    """Degrees and centimetres by which each axis was moved."""
    delta = after @ invert(INITIAL)
    pitch, yaw, roll = np.degrees(euler_xyz(delta[:3, :3]))
    return dict(zip(AXES, [roll, pitch, yaw, *(100 * delta[:3, 3])], strict=True))


@pytest.mark.parametrize("fixed", [("x", "y", "z"), ("roll", "pitch")])
def test_fixed_axes_stay_in_every_stage_and_the_others_move(frame: Frame, fixed: tuple[str, ...]) -> None:
    trace = cascade(Prior.of(fixed)).calibrate(frame, INITIAL)
    for stage in trace.stages:
        found = moved(stage.after)
        assert all(abs(found[axis]) < 0.01 for axis in fixed), found
        np.testing.assert_allclose(stage.correction @ stage.before, stage.after, atol=1e-12)
    found = moved(trace.arrived)
    assert max(abs(found[axis]) for axis in AXES if axis not in fixed) > 0.05


def test_fixed_axes_stay_in_a_drive_whose_edges_are_aligned(frame: Frame) -> None:
    free, held = (cascade(prior).calibrate_drive([frame, frame], INITIAL) for prior in (Prior(), Prior.of("xyz")))
    assert max(abs(moved(free.camera_from_lidar)[axis]) for axis in "xyz") > 0.1
    for estimate in (held, held.networks):
        assert estimate is not None
        assert all(abs(moved(estimate.camera_from_lidar)[axis]) < 0.02 for axis in "xyz")
    assert held.translation_cm < 0.01 < free.translation_cm
    assert held.verdict is not None and held.verdict.covariance is not None


def test_what_is_known_well_is_moved_less(frame: Frame) -> None:
    found = [
        np.linalg.norm(
            cascade(Prior.of((), sigma)).calibrate_drive([frame, frame], INITIAL).camera_from_lidar - INITIAL
        )
        for sigma in (0.001, 0.1)
    ]
    assert found[0] < found[1]


def test_the_covariance_of_a_frame_knows_what_is_fixed(frame: Frame) -> None:
    verdict = cascade(Prior.of("xyz")).calibrate(frame, INITIAL).verdict
    assert verdict is not None
    if verdict.covariance is not None:
        assert np.sqrt(np.trace(verdict.covariance[:3, :3])) < 1e-4


def test_networks_count_as_much_against_a_prior_as_their_results_were_measured_to_be_worth(frame: Frame) -> None:
    prior = Prior.of((), 0.1, np.radians(2))
    exact, vague = (
        cascade(prior).with_coefficients(Coefficients(covariance=CovarianceModel(share, metres, degrees)))
        for share, metres, degrees in ((1.0, 1e-3, 1e-2), (1e-4, 1.0, 30.0))
    )
    assert np.abs(vague.calibrate(frame, INITIAL).arrived - INITIAL).max() < 0.01
    assert np.abs(exact.calibrate(frame, INITIAL).arrived - INITIAL).max() > 0.05


def test_a_head_that_states_no_information_is_not_drowned_by_a_prior() -> None:
    """It counts as one that errs by a third of its range, ±5° here: more than a prior of 5°."""
    correction = miscalibration([2.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    look = StageTrace(3, RANGES[2], CAMERA, INITIAL, correction @ INITIAL, correction)
    fused = with_prior(look, Prior.of((), None, np.radians(5)).about(INITIAL), CovarianceModel())
    turned = pose_error(fused.correction, np.eye(4)).rotation_deg
    assert 0.8 * 2.0 < turned < 2.0
