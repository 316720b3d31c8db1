"""Calib-Anything, after Luo, Yan & Li (2023); our own implementation.

"Calib-Anything: Zero-training LiDAR-camera extrinsic calibration method using Segment Anything", arXiv 2306.02656.

Points that fall into one mask of the image should be alike: `masks` segments the image, `attributes` computes the
reflectance, normal and segment of every point, `consistency` scores how alike these are within masks, and `method`
searches at random around the guess for the extrinsic with the best score.
"""

from calibnet.methods.calib_anything.method import CalibAnything

__all__ = ["CalibAnything"]
