from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from calibnet.alignment import Evidence
from calibnet.drive.consensus import Consensus
from calibnet.geometry import RANGES, miscalibration, pose_error
from calibnet.geometry.se3 import (
    pose_from_vector,
    pose_vector,
    rotation_angle,
    rotation_from_vector,
    rotation_jacobian,
    rotation_vector,
)
from calibnet.geometry.types import Transform
from calibnet.trace import Estimate
from tests.support.fakes import REFERENCE

PRIOR = RANGES[2].information
TRUTH = miscalibration([0.5, -0.8, 1.2], [0.05, -0.1, 0.08])
"""The correction that all frames should agree on."""
SIGMA = np.array([0.1, 0.1, 0.2, 0.004, 0.004, 0.004])
"""Of a frame's error: metres and radians."""


def drive(frames: int, lost: int = 0, seed: int = 0, stated: float = 1.0) -> Consensus:
    """Frames scattered around the truth; ``lost`` of them far off, and as sure of themselves as the rest."""
    generator = np.random.default_rng(seed)
    consensus = Consensus(REFERENCE, RANGES[2])
    for number in range(frames):
        error = generator.normal(size=6) * SIGMA * (40 if number < lost else 1)
        correction = np.eye(4)
        correction[:3, :3] = rotation_from_vector(error[3:]) @ TRUTH[:3, :3]
        correction[:3, 3] = TRUTH[:3, 3] + error[:3]
        consensus.add(correction, np.diag((stated * SIGMA) ** -2) + PRIOR)
    return consensus


def error_of(estimate: Estimate) -> tuple[float, float]:
    error = pose_error(estimate.camera_from_lidar, TRUTH @ REFERENCE)
    return error.rotation_deg, error.translation_cm


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 2.5])
def test_rotation_vectors_are_inverted(angle: float) -> None:
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3
    rotation = rotation_from_vector(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rotation_vector(rotation), vector, atol=1e-12)
    assert rotation_angle(rotation) == pytest.approx(angle, abs=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.3, 2.5])
def test_rotation_jacobian_turns_changes_of_the_vector_into_turns(angle: float) -> None:
    vector, change = angle * np.array([2.0, -1.0, 2.0]) / 3, 1e-5 * np.array([1.0, 2.0, -1.0])
    turned = rotation_from_vector(rotation_jacobian(vector) @ change) @ rotation_from_vector(vector)
    np.testing.assert_allclose(turned, rotation_from_vector(vector + change), atol=1e-9)


def test_many_frames_are_better_than_one() -> None:
    one = np.mean([error_of(drive(1, seed=seed).estimate()) for seed in range(20)], axis=0)
    many = np.mean([error_of(drive(25, seed=seed).estimate()) for seed in range(20)], axis=0)
    assert (many < 0.35 * one).all(), "errors fall with the root of the number of frames"


def test_lost_frames_do_not_count() -> None:
    clean, spoilt = error_of(drive(30).estimate()), error_of(drive(30, lost=6).estimate())
    assert spoilt[0] < clean[0] + 0.15 and spoilt[1] < clean[1] + 5


def test_covariance_is_that_of_the_scatter_even_if_the_frames_are_too_sure() -> None:
    for stated in (1.0, 0.1):
        estimates = [drive(20, seed=seed, stated=stated).estimate() for seed in range(60)]
        errors = np.array([error_of(estimate) for estimate in estimates])
        claimed = np.array([(estimate.rotation_deg, estimate.translation_cm) for estimate in estimates])
        ratio = np.sqrt((errors**2).mean(0)) / np.sqrt((claimed**2).mean(0))
        assert ((ratio > 0.7) & (ratio < 1.4)).all(), f"claimed and true errors differ by {ratio}"


def test_uncertain_directions_are_left_to_frames_that_know_them() -> None:
    consensus = Consensus(REFERENCE, RANGES[2])
    off = TRUTH.copy()
    off[2, 3] += 2.0
    vague = PRIOR + np.diag([1e4, 1e4, 1e-2, 1e5, 1e5, 1e5])
    for correction, information in ((off, vague), (TRUTH, PRIOR + np.diag([1e4] * 3 + [1e5] * 3)), (TRUTH, vague)):
        consensus.add(correction, information)
    assert error_of(consensus.estimate())[1] < 2.0


def test_heads_without_uncertainty_are_averaged_robustly() -> None:
    consensus = Consensus(REFERENCE, RANGES[2])
    generator = np.random.default_rng(1)
    for number in range(9):
        shift = np.array([3.0, 0, 0]) if number == 0 else generator.normal(0, 0.01, 3)
        correction = TRUTH.copy()
        correction[:3, 3] += shift
        consensus.add(correction, None)
    assert error_of(consensus.estimate())[1] < 8


def test_no_frames_are_an_error() -> None:
    with pytest.raises(ValueError, match="no frame"):
        Consensus(REFERENCE, RANGES[2]).estimate()


COMMON = np.diag(np.square([0.08] * 3 + [np.radians(0.12)] * 3))
"""Covariance of what networks get wrong in all frames alike."""


class Pull:
    """Evidence that pulls towards a correction."""

    def __init__(self, towards: NDArray[np.float64], firmness: float) -> None:
        self.towards, self.firmness = towards, firmness / np.square([0.08] * 3 + [np.radians(0.12)] * 3)

    def __call__(self, correction: Transform) -> tuple[float, NDArray[np.float64]]:
        offset = pose_vector(correction) - self.towards
        return 0.5 * float(offset @ (self.firmness * offset)), self.firmness * offset


def test_evidence_moves_what_frames_agree_on() -> None:
    consensus = drive(30)
    consensus.common_error = COMMON
    agreed, towards = consensus.estimate(), pose_vector(TRUTH) + np.array([0.05, 0, 0, 0, 0.001, 0])
    still = consensus.aligned([])
    np.testing.assert_allclose(still.camera_from_lidar, agreed.camera_from_lidar, atol=1e-9)
    np.testing.assert_allclose(still.covariance, agreed.covariance + COMMON, rtol=1e-6)
    firm = consensus.aligned([Evidence((Pull(towards, 10.0),))], [agreed, still])
    target = pose_from_vector(towards) @ REFERENCE
    assert pose_error(firm.camera_from_lidar, target).translation_cm < 0.5
    assert pose_error(agreed.camera_from_lidar, target).translation_cm > 3
    assert firm.translation_cm < 0.2 * still.translation_cm and firm.frames == 30


def test_frames_that_scatter_too_far_are_not_aligned() -> None:
    consensus = Consensus(REFERENCE, RANGES[2])
    for shift in (-3.0, -1.0, 1.0, 3.0):
        correction = TRUTH.copy()
        correction[0, 3] += shift
        consensus.add(correction, None)
    assert consensus.estimate().translation_cm > 30
    pulled = consensus.aligned([Evidence((Pull(np.ones(6), 10.0),))])
    np.testing.assert_allclose(pulled.camera_from_lidar, consensus.estimate().camera_from_lidar, atol=1e-6)
