"""Calib-Anything: alike within masks where the pose is right, less so away from there, with any kind of masks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calibnet.errors import CalibrationError, ConfigError
from calibnet.geometry import MiscalibrationRange, miscalibration, pose_error
from calibnet.methods.calib_anything import CalibAnything
from calibnet.methods.calib_anything.attributes import Attributes, attributes
from calibnet.methods.calib_anything.consistency import Consistency
from calibnet.methods.calib_anything.masks import read_masks, segmented
from tests.support.boxes import BOXES, CAMERA, REFERENCE, boxes

RANGE = MiscalibrationRange(2, 0.2)


def two_halves(reflectance: NDArray[np.float64]) -> tuple[NDArray[np.int64], Attributes]:
    """Masks left and right, and points in both, those of the left first; all on one plane and of one segment."""
    labels = np.zeros((CAMERA.height, CAMERA.width), np.int64)
    labels[:, CAMERA.width // 2 :] = 1
    u, v = np.meshgrid(np.linspace(20, 1000, 40), np.linspace(20, 300, 20))
    u, v = np.sort(u.ravel()), v.ravel()
    ahead = np.full(u.shape, 10.0)
    x, y = (u - 511.5) / 580 * ahead, (v - 159.5) / 580 * ahead
    points = np.stack([ahead, -x, -y], axis=1).astype(np.float32)
    normals = np.tile([-1.0, 0, 0], (len(u), 1))
    return labels, Attributes(points, reflectance[:, None].repeat(400, 1).ravel(), normals, np.zeros(len(u), np.int64))


def test_the_score_is_one_where_masks_part_what_differs() -> None:
    labels, scan = two_halves(np.array([0.0, 1.0]))
    score = Consistency(labels, CAMERA, scan, REFERENCE)
    weight = 0.35  # of reflectance; all else is alike everywhere, and tells nothing
    assert score(REFERENCE) == pytest.approx(weight, abs=1e-3)
    assert score(miscalibration([0, 0, 5], [0, 0, 0]) @ REFERENCE) < 0.8 * weight


def test_points_that_leave_the_image_count_as_chance() -> None:
    labels, scan = two_halves(np.array([0.0, 1.0]))
    score = Consistency(labels, CAMERA, scan, REFERENCE)
    away = miscalibration([0, 0, 41], [0, 0, 0]) @ REFERENCE  # half of the image is turned away from
    assert 0 <= score(away) < 0.6 * score(REFERENCE)


def test_small_rotations_are_taken_back() -> None:
    left = []
    for seed in range(3):
        angles = np.random.default_rng(seed).uniform(-1.5, 1.5, 3)
        initial = miscalibration(angles, [0, 0, 0]) @ REFERENCE
        trace = CalibAnything(RANGE).calibrate(boxes(), initial, detail=True)
        left.append(pose_error(trace.corrected, REFERENCE).rotation_deg / pose_error(initial, REFERENCE).rotation_deg)
        (curve,) = trace.stages[0].curves
        assert (np.diff(curve.values) >= 0).all() and curve.values[-1] > curve.values[0]
        assert trace.stages[0].exhibits[0].name == "Masks"
    assert np.mean(left) < 0.4


def test_planes_and_things_are_segments_of_their_own() -> None:
    scan = boxes().points
    found = attributes(scan)
    depth = found.points[:, 0]
    of = [set(np.unique(found.segments[np.abs(depth - metres) < 0.01])) for metres in (30, 8, 12, 6)]
    largest = [np.bincount(found.segments[np.abs(depth - metres) < 0.01]).argmax() for metres in (30, 8, 12, 6)]
    assert len(set(largest)) == 4, of
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0, atol=1e-6)


def test_the_image_is_cut_along_its_edges() -> None:
    labels = segmented(boxes(), CAMERA)
    for left, top, right, bottom, _ in BOXES:
        inside = labels[top + 6 : bottom - 6, left + 6 : right - 6]
        assert (inside == inside[0, 0]).mean() > 0.95 and labels[top - 8, left - 8] != inside[0, 0]


def write_masks(folder: Path, size: tuple[int, int] = (320, 1024)) -> Path:
    """Masks of the boxes, and one of the whole image, as Segment Anything's script writes them."""
    where = folder / "000007"
    where.mkdir(parents=True)
    for number, (left, top, right, bottom, _) in enumerate([*BOXES, (0, 0, 1024, 320, 0)]):
        mask = np.zeros(size, np.uint8)
        mask[top:bottom, left:right] = 255
        cv2.imwrite(str(where / f"{number}.png"), mask)
    return folder


def test_masks_are_read_from_a_folder_by_the_images_name(tmp_path: Path) -> None:
    frame = replace(boxes(), source="somewhere/000007.png")
    labels = read_masks(write_masks(tmp_path), frame, CAMERA)
    left, top, right, bottom, _ = BOXES[0]
    assert labels[0, 0] == -1, "what covers half of the image or more tells nothing"
    assert len(set(labels[top:bottom, left:right].ravel())) == 1
    initial = miscalibration([0, 0, 1.5], [0, 0, 0]) @ REFERENCE
    found = CalibAnything(RANGE, masks=tmp_path).calibrate(frame, initial).corrected
    assert pose_error(found, REFERENCE).yaw_deg == pytest.approx(0, abs=0.5)


@pytest.mark.parametrize(
    ("source", "size", "sentence"),
    [("000008.png", (320, 1024), "has no masks"), ("000007.png", (400, 1200), "has 1200 x 400 pixels")],
)
def test_masks_that_do_not_fit_are_a_sentence(
    tmp_path: Path, source: str, size: tuple[int, int], sentence: str
) -> None:
    write_masks(tmp_path, size)
    with pytest.raises(ConfigError, match=sentence):
        CalibAnything(RANGE, masks=tmp_path).calibrate(replace(boxes(), source=source), REFERENCE)


def test_a_guess_that_looks_away_is_refused() -> None:
    away = miscalibration([0, 0, 180], [0, 0, 0]) @ REFERENCE
    with pytest.raises(CalibrationError, match="give a better guess"):
        CalibAnything(RANGE).calibrate(boxes(), away)
