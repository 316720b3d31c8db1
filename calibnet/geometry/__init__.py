"""SE(3), the pinhole camera, projection with a z-buffer, and miscalibration sampling (NumPy only)."""

from calibnet.geometry.camera import PinholeCamera
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.miscalibration import (
    RANGES,
    MiscalibrationRange,
    is_finest,
    miscalibration,
    range_of,
    sample_miscalibration,
    scaled,
    stages_within,
)
from calibnet.geometry.projection import Projection, depth_image, project, project_through
from calibnet.geometry.se3 import (
    PoseError,
    degrees_and_cm,
    euler_xyz,
    invert,
    orthonormal,
    pose_error,
    rotation_angle,
    rotation_from_euler_xyz,
    rotation_from_vector,
    rotation_vector,
    transform,
    transform_points,
)

__all__ = [
    "RANGES",
    "CameraModel",
    "MiscalibrationRange",
    "PinholeCamera",
    "PoseError",
    "Projection",
    "degrees_and_cm",
    "depth_image",
    "euler_xyz",
    "invert",
    "is_finest",
    "miscalibration",
    "orthonormal",
    "pose_error",
    "project",
    "project_through",
    "range_of",
    "rotation_angle",
    "rotation_from_euler_xyz",
    "rotation_from_vector",
    "rotation_vector",
    "sample_miscalibration",
    "scaled",
    "stages_within",
    "transform",
    "transform_points",
]
