"""URDF, Autoware's calibration and koide3's calib.json, read back by other means than they were written."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.datasets.calibration_files import FrameChoice, Wanted, read_calibration
from calibnet.errors import ConfigError
from calibnet.geometry import invert
from calibnet.verdict import ACCEPTED, Verdict
from inspector.export.conformance import check_export_format, example
from inspector.export.exported import FrameNames
from inspector.export.registry import FORMATS, export_as, suffix_of
from inspector.export.robots import as_autoware, as_koide3, as_urdf

COVARIANCE = 1e-3 * np.cov(np.random.default_rng(0).normal(size=(6, 20)))
JUDGED = replace(example(), verdict=Verdict(ACCEPTED, "Good.", example().camera_from_lidar, covariance=COVARIANCE))


@pytest.mark.parametrize("write", [as_urdf, as_autoware, as_koide3])
def test_every_promise_of_a_format_is_kept(write):
    check_export_format(write)


def covariance_in(form: str, path: Path) -> np.ndarray:
    """What a file says of it, in a field where it has such, else in a comment."""
    if form == "opencv":
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)  # a node lives no longer than it
        return storage.getNode("covariance").mat()
    if path.suffix == ".json":
        content = json.loads(path.read_text())
        return np.array((content.get("meta") or content)["covariance"])
    (rows,) = re.findall(r"Covariance of .* in the camera's frame: ([-\d.e; ]+)", path.read_text())
    return np.array([row.split() for row in rows.rstrip(" -").split(";")], float)


@pytest.mark.parametrize("form", FORMATS.names())
def test_every_format_has_the_covariance_and_is_taken_back_as_a_guess(form, tmp_path: Path):
    path = tmp_path / f"found.{suffix_of(form)}"
    path.write_text(export_as(form, JUDGED))
    assert_allclose(covariance_in(form, path), COVARIANCE, rtol=1e-8)
    found = read_calibration(path, Wanted(image=(640, 480)))
    assert_allclose(found.camera_from_lidar, example().camera_from_lidar, atol=1e-9)
    assert (found.camera is None) == (form in ("ros", "urdf", "autoware"))
    if found.camera is not None and form != "kitti":  # which has no lens
        assert found.camera.same(example().camera)
    path.write_text(export_as(form, example()))
    assert "Covariance" not in path.read_text(), "nothing is said where nothing is known"


def test_they_are_formats_of_the_command():
    assert {"urdf", "autoware", "koide3"} <= set(FORMATS.names())
    assert export_as("urdf", example()) == as_urdf(example())


@pytest.mark.parametrize("lidar_is_parent", [True, False])
def test_a_joint_of_urdf_is_the_pose_of_the_child(lidar_is_parent):
    frames = FrameNames("front/optical", "velodyne", lidar_is_parent)
    text = as_urdf(replace(example(), frames=frames, origin="two -- hyphens"))
    joint = ElementTree.fromstring(f"<robot>{text}</robot>").find("joint")
    assert joint is not None and joint.get("type") == "fixed" and "/" not in str(joint.get("name"))
    names = [joint.find(tag).get("link") for tag in ("parent", "child")]
    assert names == (["velodyne", "front/optical"] if lidar_is_parent else ["front/optical", "velodyne"])
    origin = joint.find("origin")
    roll, pitch, yaw = map(float, origin.get("rpy").split())
    turns = [cv2.Rodrigues(angle * np.eye(3)[axis])[0] for axis, angle in enumerate((roll, pitch, yaw))]
    expected = invert(example().camera_from_lidar) if lidar_is_parent else example().camera_from_lidar
    assert_allclose(turns[2] @ turns[1] @ turns[0], expected[:3, :3], atol=1e-9)
    assert_allclose([float(word) for word in origin.get("xyz").split()], expected[:3, 3])


@pytest.mark.parametrize("camera", ["camera_optical_frame", "front", "camera0/camera_optical_link"])
def test_autoware_s_file_is_read_back(camera, tmp_path: Path):
    path = tmp_path / "sensor_kit_calibration.yaml"
    path.write_text(as_autoware(replace(example(), frames=FrameNames(camera, "velodyne_top"))))
    found = read_calibration(path)
    assert found.kind == "Autoware's calibration" and found.camera_from_lidar is not None
    assert_allclose(found.camera_from_lidar, example().camera_from_lidar, atol=1e-12)
    link = path.read_text().splitlines()[-7].strip()
    assert link.endswith("camera_link:")


def test_koide3_s_file_is_read_back(tmp_path: Path):
    path = tmp_path / "calib.json"
    picture = tmp_path / "a.png"
    cv2.imwrite(str(picture), np.zeros((480, 640, 3), np.uint8))
    lenses = [
        ("plumb_bob", [-0.3, 0.1, 0.001, -0.002, 0.05]),
        ("equidistant", [0.1, 0.01, 0.0, 0.001]),
        ("omnidirectional", [1.2, -0.1, 0.05, 0.001, 0.002]),
    ]
    for model, coefficients in lenses:
        camera = replace(example().camera, model=model, coefficients=np.array(coefficients))
        path.write_text(as_koide3(replace(JUDGED, camera=camera)))
        found = read_calibration(path, Wanted(None, FrameChoice(), picture))
        assert found.camera is not None and found.camera.same(camera)
        assert_allclose(found.camera_from_lidar, example().camera_from_lidar, atol=1e-12)
    double_sphere = replace(example().camera, model="double_sphere", coefficients=np.array([0.1, 0.5]))
    with pytest.raises(ConfigError, match="does not support the lens double_sphere; export as json, opencv or yaml"):
        as_koide3(replace(example(), camera=double_sphere))
