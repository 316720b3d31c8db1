"""What cannot be right is refused with its cause; what hardly can is kept beside the frame; what can is left alone."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from calibnet.datasets.clouds.plausibility import of_scan
from calibnet.datasets.images.files import read_image
from calibnet.datasets.images.plausibility import bit_depth, mosaic
from calibnet.datasets.plausibility import (
    Implausible,
    distortion,
    focal_length,
    of_camera,
    of_extrinsic,
    suspicion,
)
from calibnet.datasets.synthetic import SyntheticSequence
from calibnet.errors import DatasetError, ImplausibleError
from calibnet.geometry import CameraModel, PinholeCamera, invert, rotation_from_euler_xyz, transform

AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
EXTRINSIC = transform(AXES, [0.1, -0.2, -0.3])


def camera(fx: float, fy: float, cx: float, cy: float, width: int = 1280, height: int = 720) -> PinholeCamera:
    return PinholeCamera(width, height, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]))


def names(found: list[Implausible | None]) -> list[tuple[str, bool]]:
    return [(remark.name, remark.certain) for remark in found if remark is not None]


def scene(seed: int = 0) -> np.ndarray:
    """A street's worth of points: wide, and some metres high."""
    return np.random.default_rng(seed).uniform([-40, -20, -2, 0], [40, 20, 3, 1], (3000, 4)).astype(np.float32)


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ((900.0, 900.0, 639.5, 359.5), []),
        ((0.703, 1.25, 0.4996, 0.4993), [("focal-length", True), ("principal-point", False)]),  # shares of the sides
        ((8.0, 8.0, 639.5, 359.5), [("focal-length", True)]),  # millimetres
        ((9100.0, 9100.0, 639.5, 359.5), []),  # 8.05 degrees across
        ((9200.0, 9200.0, 639.5, 359.5), [("focal-length", True)]),
        ((172.0, 172.0, 639.5, 359.5), []),  # 149.9 degrees
        ((170.0, 170.0, 639.5, 359.5), [("focal-length", True)]),
        ((900.0, 675.0, 639.5, 359.5), [("focal-length", False)]),  # resized to another shape
        ((900.0, 300.0, 639.5, 359.5), [("focal-length", True)]),
        ((1800.0, 1800.0, 1279.5, 719.5), [("picture-size", True)]),  # of 2560x1440
        ((450.0, 450.0, 319.5, 179.5), [("picture-size", True)]),  # of 640x360
        ((1350.0, 1350.0, 960.0, 540.0), [("picture-size", False)]),  # of 1920x1080
        ((900.0, 900.0, 639.5, 650.0), [("principal-point", False)]),  # the sky is cut off
        ((900.0, 900.0, 639.5, -400.0), [("principal-point", True)]),
    ],
)
def test_the_camera_matrix_against_its_image(values, found):
    assert names(of_camera(camera(*values))) == found


def test_what_is_meant_by_a_focal_length_is_said():
    normalised, millimetres = focal_length(camera(0.703, 1.25, 0.5, 0.5)), focal_length(camera(8, 8, 640, 360))
    assert normalised is not None and "a share of the width, so multiply by that (900 px)" in normalised.text
    assert millimetres is not None and "would see 179 degrees; it seems to be in millimetres" in millimetres.text


@pytest.mark.parametrize(
    ("extrinsic", "found"),
    [
        (EXTRINSIC, []),
        (transform(rotation_from_euler_xyz([0.9, 0.4, 0.3]) @ AXES, [0, 0, 0]), []),  # looks 50 degrees down
        (transform(np.diag([-1.0, -1.0, 1.0]) @ AXES, [0, 0, 0]), []),  # on its head
        (transform(AXES, [100.0, -200.0, -300.0]), [("units", True)]),  # millimetres
        (np.eye(4), [("axes", False)]),
        (invert(EXTRINSIC), [("axes", False)]),
    ],
)
def test_the_extrinsic_against_what_can_be_mounted(extrinsic, found):
    assert names(of_extrinsic(extrinsic)) == found


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda points: points, []),
        (lambda points: 0.2 * points, []),  # a room
        (lambda points: 1000 * points, [("units", True)]),
        (lambda points: points / 1000, [("units", True)]),
        (lambda points: points + np.array([4e5, 5e6, 0, 0]), [("units", True)]),  # coordinates of a map
        (lambda points: points[:, [0, 2, 1, 3]], [("axes", False)]),  # y up
        (lambda points: points[:, [2, 0, 1, 3]], [("axes", False)]),  # x up
    ],
)
def test_the_scan_against_the_world(change, found):
    assert names(of_scan(change(scene()).astype(np.float32))) == found


def texture(seed: int = 0) -> np.ndarray:
    """A smooth 12-bit image, 0..4095, that uses the whole range."""
    noise = np.random.default_rng(seed).uniform(0, 4095, (9, 16, 3)).astype(np.float32)
    return cv2.resize(noise, (1280, 720), interpolation=cv2.INTER_CUBIC).clip(0, 4095)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda picture: picture / 16, []),
        (lambda picture: picture / 16 * 0.2, []),  # dusk
        (lambda picture: 255.0 * (picture > 2000), []),  # black and white
        (lambda picture: picture / 256, [("bit-depth", True)]),  # 12 bits taken for 16: no brighter than 15
        (lambda picture: picture / 200, [("bit-depth", False)]),  # no brighter than 20
        (lambda picture: picture.astype(np.int64) % 256, [("bit-depth", False)]),  # the upper four bits cut off
    ],
)
def test_the_image_against_its_bits(change, found):
    assert names([bit_depth(change(texture()).astype(np.uint8))]) == found


def test_an_image_of_a_bayer_sensor_is_known_by_its_neighbours():
    colours = (texture() / 16).astype(np.uint8)
    grey = np.repeat(colours[..., 1:2], 3, axis=2)
    raw = colours[..., 1].copy()
    raw[0::2, 0::2], raw[1::2, 1::2] = colours[0::2, 0::2, 0], colours[1::2, 1::2, 2]
    assert names([mosaic(np.repeat(raw[..., None], 3, axis=2))]) == [("bayer", False)]
    assert names([mosaic(grey), mosaic(colours), mosaic(np.zeros_like(grey))]) == []


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_an_image_of_16_bits_is_read_as_bright_as_its_camera_meant_it(bits, tmp_path):
    """Cameras give 10 or 12 bits and files hold 16: read as the latter they would be almost black."""
    levels = np.random.default_rng(bits).integers(0, 256, (40, 50, 3)).astype(np.uint8)
    levels[0, 0] = 255
    for suffix in (".png", ".tiff"):
        path = tmp_path / f"picture{suffix}"
        cv2.imwrite(str(path), (levels.astype(np.uint16) << (bits - 8))[..., ::-1])
        np.testing.assert_array_equal(read_image(path), levels)


def test_what_cannot_be_right_is_refused_when_a_folder_is_opened(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(camera_matrix=[[0.9, 0, 0.5], [0, 1.3, 0.5], [0, 0, 1]]))
    with pytest.raises(ImplausibleError, match=r"calibration\.yaml: the focal length 0\.9 px .* would see") as caught:
        layout.open()
    assert caught.value.cause == "focal-length"


def test_a_mirrored_extrinsic_is_refused_as_left_handed(write_layout, write_calibration):
    layout = write_layout("folder")
    mirrored = np.diag([-1.0, 1, 1, 1]) @ EXTRINSIC
    layout.calibration.write_text(write_calibration(camera_from_lidar=mirrored.tolist()))
    with pytest.raises(ImplausibleError, match=r"is a reflection .* left-handed; negate one of its axes") as caught:
        layout.open()
    assert caught.value.cause == "left-handed"


def test_millimetres_are_refused_with_the_scan_s_name(write_layout):
    layout = write_layout("folder")
    points = layout.points[1].copy()
    points[:, :3] *= 1000
    points.tofile(layout.scans[1])
    sequence = layout.open()
    assert sequence[0].remarks == ()
    with pytest.raises(ImplausibleError, match=r"0001\.bin: half of its points .* in millimetres or") as caught:
        sequence[1]
    assert caught.value.cause == "units" and isinstance(caught.value, DatasetError)


def test_images_that_were_shrunk_without_their_matrix_are_refused(write_layout):
    """Also where the format has no image size of its own."""
    layout = write_layout("kitti-odometry")
    for path in layout.images:
        cv2.imwrite(str(path), cv2.resize(cv2.imread(str(path)), (32, 24)))
    with pytest.raises(ImplausibleError, match="is the middle of an image of about 62x45, and this one is 32x24"):
        layout.open()[0]


def test_what_is_unlikely_stays_with_the_frame(write_layout, write_calibration):
    layout = write_layout("folder")
    assert [frame.remarks for frame in layout.open()] == [(), (), ()]
    layout.calibration.write_text(write_calibration(camera_from_lidar=np.eye(4).tolist()))
    (remark,) = layout.open()[0].remarks
    assert remark.name == "axes" and "the camera looks straight up, along the LiDAR's z axis" in remark.text


def test_the_synthetic_world_is_plausible():
    for frame in SyntheticSequence(seed=5, length=2):
        camera, extrinsic = frame.camera, frame.camera_from_lidar
        assert (
            names([*of_camera(camera), *of_extrinsic(extrinsic), *of_scan(frame.points), bit_depth(frame.image)]) == []
        )


def test_the_first_suspect_is_named():
    remarks = [Implausible("axes", "the camera looks up"), Implausible("units", "it is far")]
    assert suspicion(remarks, "check it") == "the camera looks up, or it is far"
    assert suspicion([], "check it") == "check it"


@pytest.mark.parametrize(
    ("coefficients", "known"),
    [
        ((0.0, 0.0, 0.0, 0.0, 0.0), True),
        ((-0.37, 0.2, 0.001, -0.0005, -0.07), True),  # KITTI's unrectified
        ((0.3, 0.0, 0.0, 0.0, 0.0), True),
        ((-2.0, 0.0, 0.0, 0.0, 0.0), False),
        ((5.0,) * 14, False),
        ((1e200,) * 5, False),
    ],
)
def test_a_lens_that_leaves_nothing_of_the_image_is_none(coefficients: tuple[float, ...], known: bool) -> None:
    model = "plumb_bob" if len(coefficients) == 5 else "rational_polynomial"
    matrix = np.array([[700.0, 0.0, 640.0], [0.0, 700.0, 360.0], [0.0, 0.0, 1.0]])
    found = distortion(CameraModel(1280, 720, matrix, model, np.array(coefficients)))
    assert (found is None) == known
    assert known or names([found]) == [("distortion", True)]
