"""Checks that an export format keeps its contract: `check_export_format`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calibnet.conformance.requirement import require
from calibnet.geometry import CameraModel, miscalibration, transform
from inspector.export.exported import Exported

SMALLEST = 1e-6
"""Smallest change, in metres or degrees, that a file must show."""


def check_export_format(write: Callable[[Exported], str]) -> None:
    """Check that a format writes whole lines of text that name their source and have every figure in full.

    Args:
        write: the format's function, as registered.

    Raises:
        AssertionError: a check fails; the sentence says which.
    """
    exported = example()
    text = write(exported)
    require(isinstance(text, str), f"The format returns {type(text).__name__} instead of text.")
    require(text.endswith("\n"), "The file does not end with a line break.")
    require(write(example()) == text, "The same calibration gives different files.")
    require(exported.origin in text, "The file does not say where the calibration comes from (`Exported.origin`).")
    for axis, name in enumerate(("roll", "pitch", "yaw", "x", "y", "z")):
        change = SMALLEST * np.eye(6)[axis]
        moved = miscalibration(change[:3], change[3:]) @ exported.camera_from_lidar
        other = write(replace(exported, camera_from_lidar=moved))
        require(other != text, f"The file does not show a change of {SMALLEST:g} (degrees or metres) in {name}.")
    require(np.array_equal(exported.camera_from_lidar, example().camera_from_lidar), "The format changes its input.")


def example() -> Exported:
    """A calibration with another number in every place."""
    rotation = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    extrinsic = miscalibration([1.1, -2.3, 0.7], [0, 0, 0]) @ transform(rotation, [0.061, -0.083, -0.271])
    matrix = np.array([[500.1, 0.0, 320.2], [0.0, 501.3, 240.4], [0.0, 0.0, 1.0]])
    camera = CameraModel(640, 480, matrix, coefficients=np.array([-0.3, 0.1, 0.001, -0.002, 0.05]))
    return Exported(extrinsic, camera, "an example, frame 7")
