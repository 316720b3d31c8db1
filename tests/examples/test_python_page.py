"""The code of docs/python.md runs from top to bottom on a folder of one's own, and gives what its comments say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

import calibnet
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The names that the page's code leaves behind, with one repeat instead of three."""
    folder = tmp_path_factory.mktemp("page")
    write_my_car(folder / "my_car")
    code = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec("\n".join(code).replace("repeats=3", "repeats=1"), names)
    names["recording"].flush()
    return names | {"folder": folder}


def write_my_car(folder: Path) -> None:
    """Two frames of the synthetic world in the plain folder's layout."""
    for name in ("images", "clouds"):
        (folder / name).mkdir(parents=True)
    for frame in (drive := SyntheticSequence(seed=0, length=2, rig=KITTI_LIKE)):
        cv2.imwrite(str(folder / "images" / f"{frame.index}.png"), frame.image[..., ::-1])
        np.save(folder / "clouds" / f"{frame.index}.npy", frame.points)
    camera = drive[0].camera
    calibration = {
        "width": camera.width,
        "height": camera.height,
        "camera_matrix": camera.matrix.tolist(),
        "distortion": [0.0] * 5,
        "camera_from_lidar": drive[0].camera_from_lidar.tolist(),
    }
    (folder / "calibration.yaml").write_text(yaml.safe_dump(calibration))


def test_errors_and_the_drive(ran: dict[str, Any]) -> None:
    reference = ran["frame"].camera_from_lidar
    assert 3.7 < calibnet.pose_error(ran["initial"], reference).rotation_deg < 3.8
    assert calibnet.pose_error(ran["estimate"].camera_from_lidar, reference).rotation_deg < 1.0
    assert ran["evaluation"].final.rotation_deg.median < 1.0 and ran["evaluation"].drives is not None


def test_shapes_are_those_that_the_comments_give(ran: dict[str, Any]) -> None:
    stage, scale = ran["stage"], ran["stage"].detail.scales[0]
    height, width = stage.camera.height, stage.camera.width
    assert stage.number == 3 and stage.detail.depth.shape == (height, width)
    cells = (height // scale.stride, width // scale.stride)
    assert stage.detail.displacement.shape == (*cells, 2) and stage.detail.confidence.shape == cells
    assert scale.volume.shape == scale.probability.shape and scale.volume.shape[2:] == cells
    np.testing.assert_allclose(scale.probability.sum(axis=(0, 1), dtype=np.float32)[scale.occupied], 1.0, atol=2e-2)
    assert len(stage.matches.points) == scale.occupied.sum()
    (logits,) = ran["kept"]  # one look
    assert len(logits) == len(stage.detail.scales)


def test_the_recording_is_written(ran: dict[str, Any]) -> None:
    assert (ran["folder"] / "my-car.rrd").stat().st_size > 100_000
