"""Kalibr's ``camchain.yaml``, ``camchain-imucam.yaml`` and the like: cameras ``cam0``, ``cam1`` and so on."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from calibnet.datasets.calibration_files import values
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile, Wanted
from calibnet.errors import DatasetError
from calibnet.geometry import invert
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.types import Transform

CAMERA_MODELS = {"pinhole": 4, "omni": 5, "ds": 6}
"""The supported projections and their numbers of intrinsics: (xi, (alpha,)) fu, fv, pu, pv."""


def is_known(content: Any) -> bool:
    """Whether the content is of a file of Kalibr."""
    return isinstance(content, Mapping) and bool(_cameras(content))


def read(content: Mapping[Any, Any], path: Path, wanted: Wanted) -> CalibrationFile:
    """Read the selected camera.

    ``T_cam_lidar`` or ``T_lidar_cam``, which some add, follow Kalibr's convention: ``T_b_a`` maps from a to b.

    Raises:
        DatasetError: the file has several cameras and none is selected, or its lens is not supported.
    """
    cameras = _cameras(content)
    name = wanted.camera if wanted.camera is not None else next(iter(cameras)) if len(cameras) == 1 else None
    if name not in cameras:
        raise DatasetError(f"Calibration {path} has the cameras {', '.join(cameras)}; choose one with --camera.")
    chosen = cameras[name]
    extrinsic = values.extrinsic(chosen, path)
    if chosen.get("T_cam_lidar") is not None:
        extrinsic = values.pose(chosen["T_cam_lidar"], path, f"{name}.T_cam_lidar")
    elif chosen.get("T_lidar_cam") is not None:
        extrinsic = invert(values.pose(chosen["T_lidar_cam"], path, f"{name}.T_lidar_cam"))
    return CalibrationFile(
        "Kalibr's camchain", _camera(chosen, path, name), extrinsic, _first_from(cameras, str(name), path)
    )


def _cameras(content: Mapping[Any, Any]) -> dict[str, Mapping[Any, Any]]:
    return {
        str(key): value
        for key, value in content.items()
        if re.fullmatch(r"cam\d+", str(key)) and isinstance(value, Mapping) and "camera_model" in value
    }


def _camera(camera: Mapping[Any, Any], path: Path, name: str) -> CameraModel:
    for key in ("intrinsics", "resolution"):
        if camera.get(key) is None:
            raise DatasetError(f"Calibration {path}: {name} has no {key}; give Kalibr's file as it is.")
    projection = str(camera["camera_model"])
    if projection not in CAMERA_MODELS:
        raise DatasetError(
            f"Calibration {path}: {name}.camera_model is {projection!r}, which is not supported; calibrate with one of "
            f"{', '.join(CAMERA_MODELS)}, or give rectified images."
        )
    intrinsics = values.numbers(camera["intrinsics"], f"{name}.intrinsics", path, (CAMERA_MODELS[projection],))
    size = values.numbers(camera["resolution"], f"{name}.resolution", path, (2,))
    width, height = (values.pixels(float(side), f"{name}.resolution", path) for side in size)
    own, (fx, fy, cx, cy) = intrinsics[:-4], intrinsics[-4:]
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    key = f"{name}.distortion_coeffs"
    lens = values.lens_model(camera.get("distortion_model") or "none", path, f"{name}.distortion_model")
    coefficients = camera.get("distortion_coeffs") or [0.0] * 4
    if projection == "ds":
        lens, coefficients = "double_sphere", own.tolist()
    elif projection == "omni":
        if lens != "plumb_bob":
            raise DatasetError(
                f"Calibration {path}: {name} is omni with {lens}, which is not supported; calibrate with omni-radtan."
            )
        lens = "omnidirectional"
        coefficients = [*own.tolist(), *values.numbers(coefficients, key, path, (4,)).tolist()]
    return values.camera((width, height), matrix, lens, coefficients, path, key)


def _first_from(cameras: Mapping[str, Mapping[Any, Any]], name: str, path: Path) -> Transform | None:
    """The transform from the named camera to the first one, by ``T_cn_cnm1`` (a camera from the one before it)."""
    chain = list(cameras)
    camera_from_first = np.eye(4)
    for one in chain[1 : chain.index(name) + 1]:
        if cameras[one].get("T_cn_cnm1") is None:
            return None
        camera_from_first = values.pose(cameras[one]["T_cn_cnm1"], path, f"{one}.T_cn_cnm1") @ camera_from_first
    return invert(camera_from_first) if len(chain) > 1 else None
