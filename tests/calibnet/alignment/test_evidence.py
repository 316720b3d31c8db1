from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.alignment import evidence as module
from calibnet.alignment import gather
from calibnet.alignment.evidence import Edges, Reflectance, bins, information_distance, ranks, scan_edges
from calibnet.geometry import PinholeCamera, miscalibration, project
from calibnet.geometry.projection import nearest_per_cell
from calibnet.geometry.se3 import pose_from_vector
from tests.support.boxes import BOXES, CAMERA, REFERENCE, boxes


@pytest.mark.parametrize("missing", [{}, {"depth_edges": False}, {"reflectance": False}])
def test_gradients_are_those_of_the_values(missing: dict[str, bool]) -> None:
    evidence = gather(boxes(**missing), miscalibration([0.1, -0.15, 0.1], [0.02, 0.03, -0.02]) @ REFERENCE)
    generator = np.random.default_rng(0)
    for _ in range(4):
        at = generator.normal(size=6) * ([0.03] * 3 + [0.002] * 3)
        direction = generator.normal(size=6) * ([0.01] * 3 + [0.001] * 3)  # long enough to average over pixels
        ahead, behind = (evidence(pose_from_vector(at + sign * direction))[0] for sign in (1, -1))
        between = np.mean(
            [evidence(pose_from_vector(at + t * direction))[1] for t in np.arange(-15, 16, 2) / 16], axis=0
        )
        assert ahead - behind == pytest.approx(2 * between @ direction, rel=0.1, abs=0.004)


def test_values_are_smallest_at_the_truth() -> None:
    evidence = gather(boxes(), REFERENCE)
    best = evidence(np.eye(4))[0]
    for axis in range(6):
        for sign in (1, -1):
            away = np.zeros(6)
            away[axis] = sign * (0.15 if axis < 3 else np.radians(0.8))
            assert evidence(pose_from_vector(away))[0] > best + 0.05


def test_terms_without_points_are_left_out() -> None:
    def kinds(**missing: bool) -> list[type]:
        return [type(term) for term in gather(boxes(**missing), REFERENCE).terms]

    assert kinds() == [Edges, Edges, Reflectance]
    assert kinds(depth_edges=False) == [Edges, Reflectance]
    assert kinds(reflectance=False) == [Edges]
    assert kinds(reflectance=False, depth_edges=False) == []
    assert gather(boxes(), miscalibration([0, 0, 120], [0, 0, 0]) @ REFERENCE).terms == ()


def test_a_grey_image_pulls_nowhere() -> None:
    value, gradient = gather(boxes(picture=False), REFERENCE)(pose_from_vector(np.full(6, 0.01)))
    assert np.isfinite(value) and np.abs(gradient).max() < 1e-6


def test_edges_of_the_scan_lie_at_the_boxes_sides() -> None:
    frame = boxes()
    projection = project(frame.points, REFERENCE, CAMERA)
    winner = nearest_per_cell(projection, CAMERA)
    at_depth, at_reflectance = scan_edges(winner, projection.depth, ranks(frame.points[projection.index, 3]))
    sides = np.array([side for left, _, right, _, _ in BOXES for side in (left, right)])
    columns = np.nonzero(at_depth)[1]
    assert len(columns) > 500 and np.abs(columns[:, None] - sides).min(axis=1).max() <= module.DEPTH_REACH
    assert (projection.depth[winner[at_depth]] < 15).all(), "the near side of an edge, not the wall"
    assert at_reflectance.any() and not (at_depth & at_reflectance).any()
    assert (projection.depth[winner[at_reflectance]] > 15).all(), "beside a jump of depth another surface begins"


def test_reflectance_beside_another_surface_is_no_edge() -> None:
    """Bright wall behind a dark box: its points beside the box lie where the camera may see the box."""
    depth = np.full((1, 40), 30.0, np.float32)
    depth[0, 15:25] = 8.0
    rank = np.where(depth < 10, 0.1, 0.9).astype(np.float64)
    rank[0, 34:] = 0.1  # a mark on the wall itself
    winner = np.arange(40)[None]
    at_depth, at_reflectance = scan_edges(winner, depth[0], rank[0])
    assert set(np.nonzero(at_depth)[1]) == {15, 16, 17, 22, 23, 24}
    assert set(np.nonzero(at_reflectance)[1]) == {31, 32, 33}


def test_few_points_count_by_their_share() -> None:
    frame = boxes(depth_edges=False)
    edges = gather(frame, REFERENCE).terms[0]
    assert isinstance(edges, Edges)
    few = Edges(edges.edges, edges.points[:: len(edges.points) // 50][:50])
    assert (edges.weight, few.weight) == (1.0, 0.5)
    value, gradient = few(np.eye(4))
    few.weight = 1.0
    np.testing.assert_allclose((2 * value, *(2 * gradient)), (few(np.eye(4))[0], *few(np.eye(4))[1]))


@pytest.mark.parametrize("size", [(1, 64), (2, 2), (40, 1)])
def test_images_of_any_size_and_spoilt_scans_are_taken(size: tuple[int, int]) -> None:
    frame = boxes()
    camera = PinholeCamera(size[1], size[0], np.array([[50.0, 0, size[1] / 2], [0, 50.0, size[0] / 2], [0, 0, 1]]))
    points = frame.points.copy()
    points[::7, 3], points[::11, 0] = np.nan, np.nan
    value, gradient = gather(
        replace(frame, image=np.zeros((*size, 3), np.uint8), camera=camera, points=points), REFERENCE
    )(np.eye(4))
    assert np.isfinite(value) and np.isfinite(gradient).all()


def test_only_so_many_points_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_POINTS", 100)
    terms = gather(boxes(), REFERENCE).terms
    assert [len(term.points) for term in terms] == [100, 100, 100]


def test_information_distance_of_known_distributions() -> None:
    assert information_distance(np.eye(4) / 4)[0] == pytest.approx(0.0)
    assert information_distance(np.full((4, 4), 1 / 16))[0] == pytest.approx(1.0)
    assert information_distance(np.pad([[1.0]], (0, 3)))[0] == 1.0
    joint = np.random.default_rng(0).uniform(size=(5, 5))
    joint /= joint.sum()
    towards = np.random.default_rng(1).normal(size=(5, 5))
    towards -= towards.mean()  # stays a distribution
    ahead, behind = (information_distance(joint + sign * 1e-5 * towards)[0] for sign in (1, -1))
    assert (ahead - behind) / 2e-5 == pytest.approx((information_distance(joint)[1] * towards).sum(), rel=1e-4)


def test_bins_share_a_level_and_ranks_ignore_the_scale() -> None:
    lower, share = bins(np.array([-1.0, 0.0, 0.5, 1.0, 2.0]))
    np.testing.assert_array_equal(lower, [0, 0, 7, 14, 14])
    np.testing.assert_allclose(share, [0, 0, 0.5, 1, 1])
    values = np.array([3.0, 1.0, 2.0, 2.0], np.float32)
    np.testing.assert_allclose(ranks(values), [0.75, 0.0, 0.25, 0.25])
    np.testing.assert_array_equal(ranks(values), ranks(values**2 * 100))
