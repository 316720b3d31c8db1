"""Which camera and which first guess a bag's frames have."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calibnet.datasets.bag import Bag, BagOptions
from calibnet.datasets.calibration_files.ros import REGION
from calibnet.errors import DatasetError
from tests.support.bags import BagWriter
from tests.support.fakes import make_frame
from tests.support.foreign_mcap import quaternion_of

FRAME = make_frame(0, width=128, height=48, points=3000)
RAW = [-0.37, 0.2, 0.001, 0.0, -0.07]
RECTIFIED = [[70.0, 0.0, 61.0, 4.0], [0.0, 71.0, 23.0, 0.0], [0.0, 0.0, 1.0, 0.0]]


def bag_of(path: Path, topics: dict[str, str | None], transforms: bool = True, **info: Any) -> Path:
    """A bag of one moment: topics of images, each with that of its CameraInfo."""
    bag = BagWriter(path, "mcap")
    for image, its_info in topics.items():
        bag.write(image, bag.raw(FRAME.image, "rgb8", 10.0), 10.0)
        if its_info is not None:
            bag.write(its_info, replace(bag.info(FRAME, "plumb_bob", RAW), **info), 10.0)
    bag.write("/points", bag.cloud(FRAME.points, 10.0), 10.0)
    if transforms:
        bag.write("/tf_static", bag.transforms(FRAME.camera_from_lidar), 10.0)
    return bag.close()


P = {"p": np.array(RECTIFIED).ravel()}


@pytest.mark.parametrize(
    "topic", ["/cam/image_rect_color", "/cam/image_rect", "/cam_rect/image", "/cam/rectified/image"]
)
def test_rectified_images_have_the_matrix_p_and_no_distortion(topic: str, tmp_path: Path) -> None:
    frame = Bag([bag_of(tmp_path / "drive", {topic: f"{topic.rpartition('/')[0]}/camera_info"}, **P)])[0]
    assert_allclose(frame.camera.matrix, np.array(RECTIFIED)[:, :3])
    assert frame.original is None
    assert_array_equal(frame.image, FRAME.image)


@pytest.mark.parametrize("topic", ["/cam/image_raw", "/direct/image", "/correct/image_color"])
def test_other_images_have_the_matrix_k_and_its_lens(topic: str, tmp_path: Path) -> None:
    frame = Bag([bag_of(tmp_path / "drive", {topic: f"{topic.rpartition('/')[0]}/camera_info"}, **P)])[0]
    assert frame.original is not None
    assert_allclose(frame.original.camera.matrix, FRAME.camera.matrix)
    assert_allclose(frame.original.camera.coefficients, RAW)


def test_rectified_images_without_their_matrix_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="this camera_info has no matrix P"):
        Bag([bag_of(tmp_path / "drive", {"/cam/image_rect": "/cam/camera_info"})])


def test_a_camera_that_nobody_calibrated_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="the camera matrix is zero, which drivers write"):
        Bag([bag_of(tmp_path / "drive", {"/cam/image_raw": "/cam/camera_info"}, k=np.zeros(9), width=0, height=0)])


WHOLE = {"width": 300, "height": 140, "k": np.array([90.0, 0, 150, 0, 91, 70, 0, 0, 1])}
"""Of a sensor of which the images, 128x48, are a part."""


@pytest.mark.parametrize(
    ("region", "binning", "expected"),
    [
        ((40, 30, 128, 48), 0, [[90.0, 0.0, 110.0], [0.0, 91.0, 40.0], [0.0, 0.0, 1.0]]),
        ((0, 0, 256, 96), 2, [[45.0, 0.0, 75.0], [0.0, 45.5, 35.0], [0.0, 0.0, 1.0]]),
        ((44, 44, 0, 0), 2, [[45.0, 0.0, 53.0], [0.0, 45.5, 13.0], [0.0, 0.0, 1.0]]),
    ],
)
def test_images_that_are_a_part_of_the_sensor_or_binned(
    region: tuple[int, ...], binning: int, expected: list[list[float]], tmp_path: Path
) -> None:
    roi = BagWriter(tmp_path / "a", "mcap").make(
        "sensor_msgs/msg/RegionOfInterest", **dict(zip(REGION, region, strict=True)), do_rectify=False
    )
    said = {"roi": roi, "binning_x": binning, "binning_y": binning}
    path = bag_of(tmp_path / "drive", {"/cam/image_raw": "/cam/camera_info"}, **said, **WHOLE)
    frame = Bag([path])[0]
    assert frame.original is not None
    assert (frame.original.camera.width, frame.original.camera.height) == (128, 48)
    assert_allclose(frame.original.camera.matrix, expected)
    assert_allclose(frame.original.camera.coefficients, RAW)
    rectified = {**said, **WHOLE, "p": np.array([90.0, 0, 150, 0, 0, 91, 70, 0, 0, 0, 1, 0])}
    path = bag_of(tmp_path / "rectified", {"/cam/image_rect": "/cam/camera_info"}, **rectified)
    assert_allclose(Bag([path])[0].camera.matrix, expected)


def test_a_part_that_is_not_of_the_sensor_is_one_sentence(tmp_path: Path) -> None:
    roi = BagWriter(tmp_path / "a", "mcap").make(
        "sensor_msgs/msg/RegionOfInterest", x_offset=40, y_offset=0, width=128, height=48, do_rectify=False
    )
    with pytest.raises(DatasetError, match=r"the region 128x48 at \(40, 0\) is not within 128x48"):
        Bag([bag_of(tmp_path / "drive", {"/cam/image_raw": "/cam/camera_info"}, roi=roi)])


def test_a_matrix_of_larger_images_is_a_suspect(tmp_path: Path) -> None:
    """As kitti2bag writes KITTI's rectified images: K, D and R of 1392x512, P of 1242x375; here a tenth of it."""
    scale = np.diag([128 / 1242, 48 / 375, 1.0])
    raw = scale @ [[959.8, 0, 696.0], [0, 956.9, 224.2], [0, 0, 1]]
    rectified = scale @ [[721.5, 0, 609.6, 44.9], [0, 721.5, 172.9, 0.2], [0, 0, 1, 0.003]]
    topics: dict[str, str | None] = {"/cam/image_raw": "/cam/camera_info"}
    mixed = Bag([bag_of(tmp_path / "drive", topics, k=raw.ravel(), p=rectified.ravel())])[0]
    assert [remark.name for remark in mixed.remarks] == ["picture-size"]
    assert "rectified already" in mixed.remarks[0].text
    assert not Bag([bag_of(tmp_path / "right", topics, **P)])[0].remarks


@pytest.mark.parametrize(
    "p", [np.zeros(12), [9, 0, 4, 0, 0, 0, 3, 0, 0, 0, 1, 0], [9, 0, 4, 0, 9, 9, 3, 0, 0, 0, 1, 0]]
)
def test_a_projection_that_is_no_camera_says_nothing_of_others(p: Sequence[float], tmp_path: Path) -> None:
    frame = Bag([bag_of(tmp_path / "drive", {"/cam/image_raw": "/cam/camera_info"}, p=np.array(p, float))])[0]
    assert frame.original is not None
    assert_allclose(frame.original.camera.matrix, FRAME.camera.matrix)
    assert not frame.remarks


def test_a_calibration_of_another_camera_is_not_taken(tmp_path: Path) -> None:
    path = bag_of(tmp_path / "drive", {"/left/image_raw": "/left/camera_info", "/right/image_raw": None})
    with pytest.raises(DatasetError, match="has several CameraInfo topics for /right/image_raw; choose one"):
        Bag([path], BagOptions(image="/right/image_raw"))
    assert Bag([path], BagOptions(image="/right/image_raw", info="/left/camera_info"))[0].camera.width == 128


def test_a_calibration_beneath_its_images_is_found(tmp_path: Path) -> None:
    path = bag_of(
        tmp_path / "drive", {"/l/image_rect": "/l/image_rect/camera_info", "/l/image_raw": "/l/camera_info"}, **P
    )
    assert Bag([path], BagOptions(image="/l/image_rect"))[0].camera.matrix[0, 0] == 70.0


def test_images_of_depth_are_none(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "drive", "mcap")
    depth = bag.compressed(FRAME.image, 10.0)
    bag.write("/depth/image_raw/compressedDepth", depth, 10.0)
    bag.write("/cam/image_raw", bag.raw(FRAME.image, "rgb8", 10.0), 10.0)
    bag.write("/cam/camera_info", bag.info(FRAME, "plumb_bob", RAW), 10.0)
    bag.write("/points", bag.cloud(FRAME.points, 10.0), 10.0)
    bag.write("/tf_static", bag.transforms(FRAME.camera_from_lidar), 10.0)
    path = bag.close()
    assert Bag([path]).image == "/cam/image_raw"
    with pytest.raises(
        DatasetError, match=r"no images in '/depth/image_raw/compressedDepth'; there are: /cam/image_raw"
    ):
        Bag([path], BagOptions(image="/depth/image_raw/compressedDepth"))


def test_a_file_that_is_named_holds_rather_than_what_is_found(tmp_path: Path) -> None:
    topics: dict[str, str | None] = {"/cam/image_raw": "/cam/camera_info"}
    path, guess = bag_of(tmp_path / "drive", topics), tmp_path / "chain.yaml"
    camera = "{camera_model: pinhole, intrinsics: [%d, 80, 64, 24], resolution: [128, 48]}"
    guess.write_text("".join(f"cam{number}: {camera % (80 + number)}\n" for number in range(2)))
    with pytest.raises(DatasetError, match="has the cameras cam0, cam1; choose one with --camera"):
        Bag([path], BagOptions(guess=guess))
    frame = Bag([path], BagOptions(guess=guess, camera="cam1"))[0]
    assert frame.camera.matrix[0, 0] == 81.0
    assert_allclose(frame.camera_from_lidar, FRAME.camera_from_lidar, atol=1e-9)
    named = Bag([path], BagOptions(guess=guess, camera="cam1", info="/cam/camera_info"))[0]
    assert named.original is not None and named.original.camera.matrix[0, 0] == FRAME.camera.matrix[0, 0]


def test_a_file_that_does_not_say_the_size_gets_that_of_the_images(tmp_path: Path) -> None:
    """As koide3's calib.json, whose tools read bags too."""
    path, guess = bag_of(tmp_path / "drive", {"/cam/image_raw": None}, transforms=False), tmp_path / "calib.json"
    lidar_from_camera = np.linalg.inv(FRAME.camera_from_lidar)
    pose = [*lidar_from_camera[:3, 3], *quaternion_of(lidar_from_camera)]
    camera = {"camera_model": "plumb_bob", "intrinsics": [80.0, 80.0, 64.0, 24.0], "distortion_coeffs": [0.0] * 5}
    guess.write_text(json.dumps({"camera": camera, "results": {"init_T_lidar_camera": pose}}))
    frame = Bag([path], BagOptions(guess=guess))[0]
    assert (frame.camera.width, frame.camera.height) == (128, 48)
    assert_allclose(frame.camera_from_lidar, FRAME.camera_from_lidar, atol=1e-6)


def test_a_file_that_says_nothing_is_refused(tmp_path: Path) -> None:
    path, guess = bag_of(tmp_path / "drive", {"/cam/image_raw": "/cam/camera_info"}), tmp_path / "notes.yaml"
    guess.write_text("source: a colleague\n")
    with pytest.raises(DatasetError, match="has neither a camera nor the pose of the LiDAR"):
        Bag([path], BagOptions(guess=guess))
