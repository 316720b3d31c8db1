"""A frame of a fisheye lens: recorded are the image as it was taken, the points in it, and the camera as it is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.datasets.calibration_files import read_calibration
from calibnet.datasets.frame import Frame, Original
from calibnet.geometry import CameraModel, transform_points
from inspector import entities
from inspector.export.exported import exported_median
from inspector.export.registry import export_as
from inspector.read.run import RecordedRun, read_run
from inspector.record.contents import Contents, Detail
from inspector.record.observation import Layout, Observation
from inspector.record.pictures.matches import StartingPoints
from inspector.record.recording import Recording, RunDescription
from tests.support.fakes import DELTA, FakeCascade, make_frame

LENS = CameraModel(
    500,
    200,
    np.array([[180.0, 0, 251.0], [0, 182.0, 99.0], [0, 0, 1]]),
    "equidistant",
    np.array([0.03, -0.01, 0.0, 0.0]),
)


def fisheye_frame() -> Frame:
    frame = make_frame(points=3000)
    return replace(frame, original=Original(np.full((200, 500, 3), 90, np.uint8), LENS))


@pytest.fixture(scope="module")
def observation() -> Observation:
    frame = fisheye_frame()
    trace = FakeCascade((3, 5), strides=(8, 16), radius=2, size=(256, 96)).calibrate(
        frame, DELTA @ frame.camera_from_lidar
    )
    return Observation(frame, trace, frame.camera_from_lidar)


@pytest.fixture(scope="module")
def run(observation: Observation, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    import rerun as rr

    file = tmp_path_factory.mktemp("lens") / "run.rrd"
    contents = Contents.of(Detail.OVERVIEW)
    layout = Layout.of(observation, contents)
    recording = Recording([rr.FileSink(file)], RunDescription("fisheye", {"seed": 0}, {"weights": "{}"}), layout)
    recording.log(observation)
    recording.close()
    return read_run(file)


def test_points_are_seen_through_the_lens(observation: Observation) -> None:
    frame = observation.frame
    projection = observation.projected(frame.camera_from_lidar)
    moved = transform_points(frame.camera_from_lidar, frame.points[projection.index, :3].astype(np.float64))
    assert_allclose(projection.pixels, LENS.see(moved).pixels, atol=1e-2)
    assert len(projection.index) > 1000


def test_images_of_a_stage_are_of_the_pinhole(observation: Observation) -> None:
    """Its cells lie in the rectified image, whatever the lens."""
    stage = observation.trace.stages[0]
    pinhole = replace(observation, frame=replace(observation.frame, original=None))
    ours, theirs = StartingPoints.of(observation, stage), StartingPoints.of(pinhole, stage)
    assert_allclose(ours.projection.pixels, theirs.projection.pixels, atol=1e-2)


def test_the_image_and_the_camera_are_recorded_as_they_are(run: RecordedRun) -> None:
    image = cv2.imdecode(np.frombuffer(run.image(0), np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (200, 500, 3)
    assert run.frames[0].camera.same(LENS)
    points = run.overlay(entities.OVERLAY_REFERENCE, 0)
    assert points.uv[:, 0].max() > 400, "in the wider image"


@pytest.mark.parametrize("form", ["json", "opencv"])
def test_an_export_of_a_lens_is_read_back(form: str, run: RecordedRun, tmp_path: Path) -> None:
    path = tmp_path / "exported"
    exported = exported_median(run)
    path.write_text(export_as(form, exported))
    found = read_calibration(path)
    assert found.camera is not None and found.camera.same(LENS)
    assert found.camera_from_lidar is not None
    assert_allclose(found.camera_from_lidar, exported.camera_from_lidar, atol=1e-9)
    if form == "json":
        assert json.loads(path.read_text())["distortion_model"] == "equidistant"


@pytest.mark.parametrize(
    ("model", "coefficients"), [("omnidirectional", [1.2, -0.1, 0.05, 0.0, 0.0]), ("double_sphere", [-0.2, 0.6])]
)
def test_coefficients_with_names_of_their_own_are_read_back(
    model, coefficients, run: RecordedRun, tmp_path: Path
) -> None:
    camera = replace(LENS, model=model, coefficients=np.array(coefficients))
    for form in ("json", "opencv"):
        path = tmp_path / form
        path.write_text(export_as(form, replace(exported_median(run), camera=camera)))
        found = read_calibration(path)
        assert found.camera is not None and found.camera.same(camera)


def test_kitti_has_no_lens_and_says_so(run: RecordedRun) -> None:
    assert "# lens: this format has no lens; first rectify the images" in export_as("kitti", exported_median(run))
