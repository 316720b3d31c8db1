from __future__ import annotations

import numpy as np

from calibnet.alignment import align, gather
from calibnet.geometry import pose_error
from calibnet.geometry.se3 import pose_from_vector
from tests.alignment.boxes import REFERENCE, boxes

SIGMA = np.array([0.08] * 3 + [0.002] * 3)


def left_over(frames: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors in degrees and centimetres before and after, and how many standard deviations are left."""
    off = np.random.default_rng(seed).normal(size=6) * SIGMA
    start = pose_from_vector(off) @ REFERENCE
    found, covariance = align([gather(boxes(), start)] * frames, np.zeros(6), np.diag(SIGMA**2))
    before, after = (pose_error(pose, REFERENCE) for pose in (start, pose_from_vector(found) @ start))
    deviations = (found + off) / np.sqrt(np.diag(covariance))
    return (
        np.array([before.rotation_deg, before.translation_cm]),
        np.array([after.rotation_deg, after.translation_cm]),
        deviations,
    )


def test_edges_take_errors_back() -> None:
    results = [left_over(4, seed) for seed in range(8)]
    before, after = (np.mean([result[part] for result in results], axis=0) for part in (0, 1))
    assert (after < 0.5 * before).all(), f"{before} to {after}"


def test_more_frames_weigh_more_against_what_is_known() -> None:
    start = pose_from_vector(np.array([0.1, 0, 0, 0, 0.003, 0])) @ REFERENCE
    evidence = gather(boxes(), start)
    firm = [align([evidence] * frames, np.zeros(6), np.diag(SIGMA**2))[1] for frames in (0, 1, 4)]
    np.testing.assert_allclose(firm[0], np.diag(SIGMA**2))
    less, more = np.linalg.eigvalsh(firm[0] - firm[1]), np.linalg.det(firm[2]) / np.linalg.det(firm[1])
    assert less.min() > -1e-12 and more < 0.5


def test_without_evidence_what_is_known_stays() -> None:
    known, covariance = np.array([0.1, 0.2, -0.1, 0.01, 0.0, 0.02]), np.diag(SIGMA**2) + 1e-7
    for start in (None, known + SIGMA):
        found, firm = align([], known, covariance, start)
        np.testing.assert_allclose(found, known, atol=0.1 * SIGMA.min())
        np.testing.assert_allclose(firm, covariance, rtol=1e-6)


def test_where_it_starts_hardly_matters() -> None:
    off = np.array([0.05, -0.04, 0.06, 0.001, -0.002, 0.001])
    evidence = [gather(boxes(), pose_from_vector(off) @ REFERENCE)] * 2
    one, _ = align(evidence, np.zeros(6), np.diag(SIGMA**2))
    other, _ = align(evidence, np.zeros(6), np.diag(SIGMA**2), one + 0.2 * SIGMA)
    assert np.abs((one - other) / SIGMA).max() < 0.5
