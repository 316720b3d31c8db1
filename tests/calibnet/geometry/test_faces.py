"""The pinhole cameras in the place of a wide lens: which way they look, and how far."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.geometry import CameraModel, PinholeCamera, rotation_from_vector, transform
from calibnet.geometry.faces import MARGIN_DEG, faces, level
from calibnet.geometry.rectification import degrees_across
from tests.support.scene import REFERENCE


def fisheye(focal: float, width: int = 400, height: int = 300) -> CameraModel:
    matrix = np.array([[focal, 0.0, width / 2 - 0.5], [0.0, focal, height / 2 - 0.5], [0.0, 0.0, 1.0]])
    return CameraModel(width, height, matrix, "equidistant", np.zeros(4))


def tilted(pitch: float, roll: float = 0.0) -> np.ndarray:
    """The extrinsic of a camera that looks so many degrees up, and leans clockwise."""
    turn = rotation_from_vector([0, 0, np.radians(roll)]) @ rotation_from_vector([np.radians(pitch), 0, 0])
    return transform(turn, np.zeros(3)) @ REFERENCE


def azimuths(found: tuple) -> list[float]:
    """Degrees to the right that level faces look, by the first one's heading."""
    headings = [face.pinhole_from_camera[2] for face in found]
    first = found[0].pinhole_from_camera
    return [float(np.degrees(np.arctan2(first[0] @ heading, first[2] @ heading))) for heading in headings]


def test_a_lens_that_one_pinhole_shows_has_none():
    assert faces(fisheye(220.0), REFERENCE) == (), "104 degrees"
    assert faces(CameraModel.of(PinholeCamera(400, 300, fisheye(200.0).matrix)), REFERENCE) == ()


def test_faces_share_the_width_of_the_lens():
    """180 degrees are three times 60, the middle one first; each sees a margin more."""
    found = faces(fisheye(120.0, 377, 180), REFERENCE)
    assert_allclose(sorted(azimuths(found)), [-60, 0, 60], atol=1.1)
    assert azimuths(found)[0] == pytest.approx(0, abs=0.01)
    assert degrees_across(found[0].pinhole) == pytest.approx(60 + 2 * MARGIN_DEG, abs=1.2)


def test_a_very_wide_pinhole_has_faces_too():
    found = faces(CameraModel.of(PinholeCamera(400, 200, fisheye(90.0).matrix)), REFERENCE)  # 131 degrees
    assert len(found) == 2
    assert_allclose([degrees_across(face.pinhole) for face in found], 69.8, atol=1.5)


@pytest.mark.parametrize(("pitch", "roll"), [(-35.0, 0.0), (20.0, 0.0), (-35.0, 180.0), (10.0, -70.0)])
def test_faces_stand_level_whichever_way_the_lens_is_tilted(pitch, roll):
    extrinsic = tilted(pitch, roll)
    up = extrinsic[:3, 2]
    found = faces(fisheye(105.0, 400, 400), extrinsic)
    assert len(found) >= 3
    for face in found:
        assert_allclose(face.pinhole_from_camera @ up, [0, -1, 0], atol=1e-12)
        assert np.linalg.det(face.pinhole_from_camera) == pytest.approx(1)


def test_a_lens_that_looks_down_has_the_faces_of_a_cube():
    assert level(tilted(-80.0)[:3, 2]) is None
    found = faces(fisheye(100.0, 400, 400), tilted(-90.0))
    assert len(found) == 5
    assert_allclose(found[0].pinhole_from_camera, np.eye(3))
    for side in found[1:]:
        assert side.pinhole_from_camera[2, 2] == pytest.approx(0, abs=1e-12), "at right angles to the axis"
    narrow = faces(fisheye(240.0, 400, 400), tilted(-90.0))
    assert narrow == ()


def test_what_is_black_in_every_image_is_cut_off():
    camera = fisheye(120.0)
    image = np.full((300, 400, 3), 200, np.uint8)
    image[:, 280:] = 0  # from 40 degrees to the right on
    found = faces(camera, REFERENCE, [image])
    assert max(azimuths(found)) < 1, "nothing is left of the face to the right"
    assert degrees_across(found[0].pinhole) == pytest.approx(63.7, abs=40), "and of the middle one"
    whole = faces(camera, REFERENCE)
    assert sum(degrees_across(face.pinhole) for face in found) < sum(degrees_across(face.pinhole) for face in whole)
