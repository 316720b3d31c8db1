"""The fake car's frames as a user's plain folder."""

from __future__ import annotations

from pathlib import Path

import cv2
import yaml

from tests.support.fakes import make_frame


def write_folder(folder: Path, frames: int) -> Path:
    """Write images, clouds and the calibration that the car has into a new folder, and return it."""
    for name in ("images", "clouds"):
        (folder / name).mkdir(parents=True)
    for index in range(frames):
        frame = make_frame(index)
        cv2.imwrite(str(folder / "images" / f"{index:04d}.png"), frame.image[:, :, ::-1])
        frame.points.tofile(folder / "clouds" / f"{index:04d}.bin")
    calibration = {
        "width": frame.camera.width,
        "height": frame.camera.height,
        "camera_matrix": frame.camera.matrix.tolist(),
        "distortion": [0.0] * 5,
        "camera_from_lidar": frame.camera_from_lidar.tolist(),
    }
    (folder / "calibration.yaml").write_text(yaml.safe_dump(calibration))
    return folder
