"""A calibration.yaml that says its geometry in another tool's words is refused with ours; notes are left alone."""

from __future__ import annotations

import pytest

from calibnet.datasets.calibration_files.unread_keys import (
    EXTRINSIC,
    INVERSE,
    LENS,
    MATRIX,
    SIZE,
    STRAIGHT,
    WHOLE,
    unread_geometry,
)
from calibnet.errors import DatasetError

NUMBERS = "[0.1, -0.2, 0.3, 0.4]"


@pytest.mark.parametrize(
    ("remedy", "keys"),
    [
        (MATRIX, "K K_02 intrinsics camera_intrinsics cameraMatrix Camera-Matrix fx fy cx cy focal_length camera_info"),
        (LENS, "D dist_coeffs distCoeffs distortion_coeff distortion_coeffs distortion_coefficients distorsion k1"),
        (
            EXTRINSIC,
            "extrinsic extrinsics T_cam_lidar T_cam0_velo Tr_velo_to_cam lidar_to_camera lidar2cam rvec T Rcl Pcl",
        ),
        (EXTRINSIC, "Camera_From_Lidar rotation translation quaternion T_camera_from_lidar lidar_camera_extrinsics"),
        (INVERSE, "T_lidar_cam T_lidar_camera camera_to_lidar cam2lidar"),
        (SIZE, "image_width image_height image_size resolution Width"),
        (WHOLE, "binning_x roi crop x_offset"),
        (STRAIGHT, "fisheye is_fisheye"),
    ],
)
def test_geometry_under_another_name_is_refused_with_what_is_right(remedy, keys, write_layout, write_calibration):
    layout = write_layout("folder")
    for key in keys.split():
        layout.calibration.write_text(write_calibration(**{key: NUMBERS}))
        with pytest.raises(DatasetError) as caught:
            layout.open()
        assert str(caught.value) == (
            f"Calibration {layout.calibration} has geometry under keys that are not read: "
            f"instead of '{key}' give {remedy}."
        )


@pytest.mark.parametrize("model", ["thin_prism", "fov", "eucm", "cylindrical", "something new"])
def test_a_lens_that_is_not_known_is_refused(model, write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(distortion_model=model))
    with pytest.raises(DatasetError, match=f"distortion_model '{model}' is not a supported lens"):
        layout.open()


@pytest.mark.parametrize("model", ["plumb_bob", "radtan", "rational_polynomial", "Plumb Bob", "none", "''", "null"])
def test_names_of_the_lens_that_is_undone_are_welcome(model, write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(distortion_model=model))
    assert len(layout.open()) == 3


def test_what_is_no_geometry_is_ignored(write_layout, write_calibration):
    notes = (
        "source licence license frames date vehicle lidar camera camera_name lidar_name rig url time timestamp place "
        "extrinsic_source distance rings points lidar_camera_delay_ms time_offset rectified board rms serial sensor"
    )
    layout = write_layout("folder")
    text = write_calibration(**dict.fromkeys(notes.split(), "'KITTI-360 fisheye, by hand'"))
    text += "camera_model: FLIR Blackfly\nlens: Kowa 6 mm\nfisheye: false\nroi: {x_offset: 0, do_rectify: false}\n"
    text += "rows_of_frames: [1, 2, 3, 4]\nsensor_weights: [[1, 2], [3, 4]]\n"
    layout.calibration.write_text(text)
    assert len(layout.open()) == 3


def test_other_words_for_the_lens_are_welcome_beside_its_model(write_layout, write_calibration):
    layout = write_layout("folder")
    for line in ("camera_model: pinhole-equi", "lens: fisheye 185", "is_fisheye: true"):
        text = write_calibration(distortion_model="equidistant", distortion=[0.1, 0, 0, 0]) + line
        layout.calibration.write_text(text)
        assert layout.open().calibration.camera.model == "equidistant"


def test_a_model_of_a_fisheye_is_refused_under_any_name(write_layout, write_calibration):
    layout = write_layout("folder")
    for line in ("camera_model: pinhole-equi", "lens: fisheye 185", "lens_model: ds", "camera_type: omni"):
        layout.calibration.write_text(write_calibration() + line)
        with pytest.raises(DatasetError, match=f"instead of '{line}' give 'distortion_model' as one of plumb_bob,"):
            layout.open()


def test_geometry_below_other_keys_is_found():
    """As Kalibr and other calibration tools write it."""
    kalibr = {"camera_model": "pinhole", "distortion_model": "equidistant", "intrinsics": [9.0, 9.0, 3.0, 2.0]}
    assert unread_geometry({"cam0": kalibr}) == [
        ("cam0.distortion_model: equidistant", STRAIGHT),
        ("cam0.intrinsics", MATRIX),
    ]
    assert unread_geometry({"results": {"T_lidar_camera": [0, 0, 0, 1]}}) == [("results.T_lidar_camera", INVERSE)]
    assert unread_geometry({"left": {"camera_matrix": [1], "width": 3}}) == [
        ("left.camera_matrix", MATRIX),
        ("left.width", SIZE),
    ]


def test_a_matrix_under_any_name_is_geometry():
    rows = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]
    assert unread_geometry({"whatever": rows}) == [("whatever", f"{MATRIX}, or {EXTRINSIC}")]
    assert unread_geometry({"whatever": rows[:2]}) == []


def test_several_keys_are_named_together(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration() + "fx: 60\nfy: 60\nD: [0.1, 0, 0, 0]\n")
    with pytest.raises(DatasetError) as caught:
        layout.open()
    assert f"not read: instead of 'fx', 'fy' give {MATRIX}; instead of 'D' give {LENS}." in str(caught.value)


def test_an_empty_value_is_a_missing_one(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(distortion=None) + "distortion:\n")
    with pytest.raises(DatasetError, match=r"no key 'distortion'; add it \(\[0, 0, 0, 0, 0\] for rectified images\)"):
        layout.open()
