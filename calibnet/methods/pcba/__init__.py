"""PCBA: plane-constrained bundle adjustment, after Li et al. (2023), in our words; no code of theirs is used.

"Joint intrinsic and extrinsic LiDAR-camera calibration in targetless environments using plane-constrained bundle
adjustment", arXiv 2308.12629.

A drive is registered scan to scan (`odometry`), points of its pictures are followed from frame to frame (`tracks`), and
the map that the scans make is cut into small planes (`planes`). `adjustment` then moves the extrinsic, and the tracked
points in space, until each is seen where it was tracked and lies on a plane of the scans; `method` does it in rounds.
"""

from calibnet.methods.pcba.method import PCBA

__all__ = ["PCBA"]
