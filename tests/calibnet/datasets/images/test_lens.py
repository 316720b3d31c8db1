"""A folder whose images are not rectified, and whose calibration is another tool's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from calibnet.errors import DatasetError

FISHEYE = {"distortion_model": "equidistant", "distortion": [0.05, -0.01, 0.0, 0.0]}


def test_an_image_of_a_fisheye_is_kept_beside_the_rectified_one(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(**FISHEYE))
    frame = layout.open()[1]
    assert_array_equal(frame.original.image, layout.pixels[1])
    assert frame.as_taken is frame.original
    assert (frame.original.camera.model, frame.original.camera.width) == ("equidistant", 64)
    assert frame.image.shape[:2] == (frame.camera.height, frame.camera.width)
    assert frame.camera.width > 64, "what a fisheye shows is wider where lines are straight"
    assert_array_equal(frame.camera_from_lidar, layout.camera_from_lidar)


def test_a_rectified_image_is_the_image_as_it_was_taken(write_layout):
    frame = write_layout("folder").open()[0]
    assert frame.original is None
    assert frame.as_taken.image is frame.image
    assert frame.as_taken.camera.is_pinhole


def test_a_wide_lens_has_faces_and_the_user_is_told(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(**FISHEYE))
    narrow = layout.open()
    assert narrow.notes == () and narrow[0].faces == ()
    matrix = [[20.0, 0, 31.5], [0, 20.0, 23.5], [0, 0, 1]]
    layout.calibration.write_text(write_calibration(**FISHEYE | {"camera_matrix": matrix, "distortion": [0.0] * 4}))
    wide = layout.open()
    (note,) = wide.notes
    assert note.startswith("The lens is wide: it is replaced by 3 pinhole cameras in its place (")
    frame = wide[0]
    assert len(frame.faces) == 3
    assert_array_equal(frame.as_taken.image, layout.pixels[0])
    for face in frame.faces:
        assert face.image.shape == (face.camera.height, face.camera.width, 3)


def ros(layout) -> str:
    values = np.ravel(layout.matrix).tolist()
    return (
        f"image_width: 64\nimage_height: 48\ncamera_matrix: {{rows: 3, cols: 3, data: {values}}}\n"
        "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
    )


def test_a_file_without_a_lidar_needs_a_guess(write_layout):
    layout = write_layout("folder")
    layout.calibration.write_text(ros(layout))
    with pytest.raises(DatasetError, match=r"\(ROS's camera_info\) has no pose of the LiDAR; give a"):
        layout.open()
    guess = layout.root.parent / "guess.yaml"
    guess.write_text(f"camera_from_lidar: {layout.camera_from_lidar.tolist()}\n")
    frame = layout.open(guess=guess)[0]
    assert_array_equal(frame.camera_from_lidar, layout.camera_from_lidar)
    assert_array_equal(frame.camera.matrix, layout.matrix)
    with pytest.raises(DatasetError, match="has no pose of a LiDAR"):
        layout.open(guess=layout.calibration)


def test_the_file_says_what_is_known(write_layout, write_calibration):
    layout = write_layout("folder")
    assert not layout.open().prior
    layout.calibration.write_text(write_calibration(fix="[x, y, z]", prior_rotation="0.5deg"))
    assert layout.open().prior.words == "known to 0.5°; x, y, z fixed"
    layout.calibration.write_text(write_calibration(prior_translation=2))
    with pytest.raises(DatasetError, match=r"calibration\.yaml: '2' is not a length with a unit"):
        layout.open()


def test_the_calibration_may_have_any_name(write_layout, write_calibration):
    layout = write_layout("folder")
    other = layout.calibration.rename(layout.root / "front.yml")
    assert len(layout.open()) == 3
    (layout.root / "rear.json").write_text("{}")
    with pytest.raises(DatasetError, match=r"several files that may be its calibration \(front\.yml, rear\.json\)"):
        layout.open()
    other.rename(layout.calibration)
    assert len(layout.open()) == 3, "calibration.yaml goes before"


def test_a_file_of_transforms_knows_no_camera(write_layout):
    layout = write_layout("folder")
    layout.calibration.write_text(
        "- {parent: velo, child: cam_optical, translation: [0, 0, 0], rpy_deg: [-90, 0, -90]}"
    )
    with pytest.raises(DatasetError, match="has no camera; put the file of the camera there"):
        layout.open()


def test_size_of_the_image_serves_files_that_do_not_say_it(write_layout):
    layout = write_layout("folder")
    layout.calibration.unlink()
    camera = {"camera_model": "plumb_bob", "distortion_coeffs": [0.0] * 5, "intrinsics": [60, 62, 31, 22.5]}
    pose = [0.2, 0.0, -0.1, -0.5, 0.5, -0.5, 0.5]
    content = f'{{"camera": {camera}, "results": {{"T_lidar_camera": {pose}}}}}'.replace("'", '"')
    (layout.root / "calib.json").write_text(content)
    assert layout.open()[0].camera.width == 64
    cv2.imwrite(str(layout.images[2]), np.zeros((24, 32, 3), np.uint8))
    with pytest.raises(DatasetError, match="is 32x24 but its calibration is for 64x48"):
        layout.open()[2]
