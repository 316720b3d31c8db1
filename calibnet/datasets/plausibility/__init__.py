"""Cheap checks whether a camera matrix, an extrinsic, a scan or an image can be right.

Each returns an `Implausible`, a sentence with a short name for machines, or None. What no sensor can have is refused
when it is read (`refuse`); what some sensor might have is kept beside the frame, and is the first suspect if image and
scan do not fit together (`suspicion`). The limits exclude no sensor that we know of.
"""

from calibnet.datasets.plausibility.calibration import (
    distortion,
    focal_length,
    of_camera,
    of_extrinsic,
    of_lens,
    rectification,
)
from calibnet.datasets.plausibility.implausible import Implausible, refuse, suspicion
from calibnet.datasets.plausibility.pictures import ROW_STEP, bit_depth, mosaic
from calibnet.datasets.plausibility.scans import of_scan, ranges, several, up

__all__ = [
    "ROW_STEP",
    "Implausible",
    "bit_depth",
    "distortion",
    "focal_length",
    "mosaic",
    "of_camera",
    "of_extrinsic",
    "of_lens",
    "of_scan",
    "ranges",
    "rectification",
    "refuse",
    "several",
    "suspicion",
    "up",
]
