"""CamOdoCal's calibration files of Mei's model, which KITTI-360's fisheyes have."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from calibnet.datasets.calibration_files import values
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile
from calibnet.errors import DatasetError

GROUPS = {
    "mirror_parameters": ("xi",),
    "distortion_parameters": ("k1", "k2", "p1", "p2"),
    "projection_parameters": ("gamma1", "gamma2", "u0", "v0"),
}
REMEDY = "give CamOdoCal's original file"


def is_known(content: Any) -> bool:
    """Whether the content is of such a file."""
    return isinstance(content, Mapping) and {"mirror_parameters", "projection_parameters"} <= content.keys()


def read(content: Mapping[Any, Any], path: Path) -> CalibrationFile:
    """Read the camera; such a file has no LiDAR.

    Raises:
        DatasetError: a parameter is missing or not a number.
    """
    found: dict[str, float] = {}
    for group, names in GROUPS.items():
        inside = content.get(group)
        for name in names:
            if not isinstance(inside, Mapping) or inside.get(name) is None:
                raise DatasetError(f"Calibration {path} has no {group}.{name}; {REMEDY}.")
            found[name] = float(values.numbers([inside[name]], f"{group}.{name}", path, (1,))[0])
    width, height = (values.pixels(content.get(side), side, path) for side in ("image_width", "image_height"))
    matrix = np.array([[found["gamma1"], 0.0, found["u0"]], [0.0, found["gamma2"], found["v0"]], [0.0, 0.0, 1.0]])
    lens = [found[name] for name in ("xi", "k1", "k2", "p1", "p2")]
    camera = values.camera((width, height), matrix, "omnidirectional", lens, path, "distortion_parameters")
    return CalibrationFile("CamOdoCal's Mei model", camera)
