"""Calib-Anything, after Luo, Yan & Li (2023), in our words; no code of theirs is used.

"Calib-Anything: Zero-training LiDAR-camera extrinsic calibration method using Segment Anything", arXiv 2306.02656.

What the picture shows as one thing should be one thing in the scan: `masks` cut the picture, `attributes` tell of every
point its reflectance, normal and segment, `consistency` scores how alike they are within masks, and `method` searches
the extrinsic with the best score at random around the guess.
"""

from calibnet.methods.calib_anything.method import CalibAnything

__all__ = ["CalibAnything"]
