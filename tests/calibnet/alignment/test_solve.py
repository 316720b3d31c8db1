from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from calibnet.alignment import Evidence, align, gather
from calibnet.geometry import pose_error
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Transform
from tests.support.boxes import REFERENCE, boxes

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


def test_edges_take_errors_back_and_the_covariance_knows_how_far() -> None:
    results = [left_over(4, seed) for seed in range(8)]
    before, after = (np.mean([result[part] for result in results], axis=0) for part in (0, 1))
    assert (after < 0.5 * before).all(), f"{before} to {after}"
    deviations = np.array([result[2] for result in results])
    assert 0.3 < np.sqrt(np.mean(deviations**2)) < 2.0


def test_more_frames_weigh_more_against_what_is_known() -> None:
    start = pose_from_vector(np.array([0.1, 0, 0, 0, 0.003, 0])) @ REFERENCE
    evidence = gather(boxes(), start)
    firm = [align([evidence] * frames, np.zeros(6), np.diag(SIGMA**2))[1] for frames in (0, 1, 4)]
    np.testing.assert_allclose(firm[0], np.diag(SIGMA**2))
    less, more = np.linalg.eigvalsh(firm[0] - firm[1]), np.linalg.det(firm[2]) / np.linalg.det(firm[1])
    assert less.min() > -1e-12 and more < 0.5


def test_more_frames_than_add_up_are_no_firmer(monkeypatch: pytest.MonkeyPatch) -> None:
    evidence = gather(boxes(), pose_from_vector(np.array([0.1, 0, 0, 0, 0.003, 0])) @ REFERENCE)
    monkeypatch.setattr("calibnet.alignment.solve.MOST_FRAMES", 2)
    two, four = (align([evidence] * frames, np.zeros(6), np.diag(SIGMA**2)) for frames in (2, 4))
    np.testing.assert_allclose(two[0], four[0], atol=1e-9)
    np.testing.assert_allclose(two[1], four[1], rtol=1e-6)


def test_without_evidence_what_is_known_stays() -> None:
    known, covariance = np.array([0.1, 0.2, -0.1, 0.01, 0.0, 0.02]), np.diag(SIGMA**2) + 1e-7
    for starts in ([], [known + SIGMA]):
        found, firm = align([], known, covariance, starts)
        np.testing.assert_allclose(found, known, atol=0.1 * SIGMA.min())
        np.testing.assert_allclose(firm, covariance, rtol=1e-6)


def two_wells(correction: Transform) -> tuple[float, NDArray[np.float64]]:
    """A shallow well 1 standard deviation to the left, a deep one 2 to the right."""
    value, gradient, x = 0.0, np.zeros(6), correction[0, 3] / SIGMA[0]
    for centre, depth in ((-1.0, 0.3), (2.0, 1.0)):
        well = depth * np.exp(-((x - centre) ** 2) / 0.2)
        value, gradient[0] = value - well, gradient[0] + well * 2 * (x - centre) / 0.2 / SIGMA[0]
    return value, gradient


def test_the_best_of_several_starts_is_taken() -> None:
    evidence, (left, right) = [Evidence((two_wells,))], (np.eye(6)[0] * SIGMA[0] * x for x in (-1.1, 2.1))
    for starts, expected in (([left], -1.0), ([right], 2.0), ([left, right], 2.0), ([right, left], 2.0)):
        found, _ = align(evidence, np.zeros(6), np.diag(SIGMA**2), starts)
        assert found[0] / SIGMA[0] == pytest.approx(expected, abs=0.2)


def test_the_range_of_a_first_stage_is_no_trouble() -> None:
    """Far from what edges can do, but with the right gradient: a turn after another is no sum of vectors."""
    start = pose_from_vector(np.array([0.3, 0.2, -0.4, 0.1, -0.2, 0.15])) @ REFERENCE
    found, covariance = align([gather(boxes(), start)], np.zeros(6), np.diag(np.square([0.87] * 3 + [0.2] * 3)))
    assert np.isfinite(found).all() and (np.linalg.eigvalsh(covariance) > 0).all()
