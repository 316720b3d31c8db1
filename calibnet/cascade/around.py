"""The steps around a network, ours or that of another paper: projecting the scan and extending the correction."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from calibnet.datasets.frame import Frame
from calibnet.datasets.plausibility import suspicion
from calibnet.errors import CalibrationError
from calibnet.geometry import PinholeCamera, orthonormal, scaled
from calibnet.geometry.types import Extrinsic, Transform
from calibnet.network.batch import LidarInput, lidar_input

FEWEST_CELLS = 20
"""Smallest number of cells with a LiDAR point from which six parameters can be estimated."""


def projected(
    frame: Frame, before: Extrinsic, camera: PinholeCamera, scales: tuple[int, ...], stage: str
) -> LidarInput:
    """The scan projected under an extrinsic, as input of a network.

    Args:
        frame: frame with the scan.
        before: ``camera_from_lidar``, 4x4.
        camera: camera of the network's input.
        scales: strides of the network's cells.
        stage: name of the stage, for messages.

    Raises:
        CalibrationError: too few LiDAR points are inside the image.
    """
    lidar = lidar_input(frame.points, before, camera, scales)
    occupied = lidar.occupied.sum()
    if occupied < FEWEST_CELLS:
        why = suspicion(
            frame.remarks,
            "check that the extrinsic maps LiDAR points (x forward, y left, z up) into the camera (x right, y down, "
            "z forward)",
        )
        raise CalibrationError(
            f"Hardly any of the {len(frame.points)} LiDAR points of frame {frame.index} ({frame.source}) fall into the "
            f"image before {stage}; {why}."
        )
    return lidar


def extended(estimate: Tensor, gain: float, frame: Frame, stage: str) -> Transform:
    """The correction ``[4, 4]`` that a network estimates, as a rigid transform scaled by ``gain``.

    Raises:
        CalibrationError: it is not finite.
    """
    correction: Transform = estimate.double().cpu().numpy()
    if not np.isfinite(correction).all():
        raise CalibrationError(
            f"The correction of frame {frame.index} ({frame.source}) by {stage} is not finite; train its weights again "
            "if this happens on every frame."
        )
    return scaled(orthonormal(correction), gain)
