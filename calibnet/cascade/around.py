"""What every stage does around its network, ours and those of other papers: project the scan, apply the correction."""

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
"""Cells with a LiDAR point below which a pose of six parameters would be a guess."""


def projected(
    frame: Frame, before: Extrinsic, camera: PinholeCamera, scales: tuple[int, ...], stage: str
) -> LidarInput:
    """The scan under an extrinsic, as a network sees it.

    Args:
        frame: its scan.
        before: ``camera_from_lidar``, 4x4.
        camera: of the network's input.
        scales: strides of the network's cells.
        stage: names it, for messages.

    Raises:
        CalibrationError: too few LiDAR points fall into the image.
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
            f"Only {occupied} cells of frame {frame.index} ({frame.source}) hold a LiDAR point before {stage}, of "
            f"{len(frame.points)} points; {why}."
        )
    return lidar


def extended(estimate: Tensor, gain: float, frame: Frame, stage: str) -> Transform:
    """The correction ``[4, 4]`` that a network estimates, as a rigid transform that goes ``gain`` times as far.

    Raises:
        CalibrationError: it is not finite.
    """
    correction: Transform = estimate.double().cpu().numpy()
    if not np.isfinite(correction).all():
        raise CalibrationError(
            f"No finite correction of frame {frame.index} ({frame.source}) comes from {stage}; train its weights again "
            "if this happens on every frame."
        )
    return scaled(orthonormal(correction), gain)
