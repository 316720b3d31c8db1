"""PCBA: plane-constrained bundle adjustment, after Li et al. (2023); our own implementation.

"Joint intrinsic and extrinsic LiDAR-camera calibration in targetless environments using plane-constrained bundle
adjustment", arXiv 2308.12629.

The scans of a drive are registered one onto the other (`calibnet.motion.odometry`), points of its images are tracked
from frame to frame (`tracks`), and the map of all scans is divided into small planes (`planes`). `adjustment` then
optimises the extrinsic and the tracked points in space, so that each point projects to where it was tracked and lies on
a plane of the map; `method` repeats this in rounds.
"""

from calibnet.methods.pcba.method import PCBA

__all__ = ["PCBA"]
