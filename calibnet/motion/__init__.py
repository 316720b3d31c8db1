"""What the motion of the car shows of the calibration: image motion as tracked, and as scan and odometry predict it.

Registering two successive scans gives the motion of the LiDAR. With the depth of the scan, the camera matrix and the
extrinsic it predicts where every pixel of one image is found in the next. Tracking the pixels shows where they really
are. This compares an image with an image, so its errors have nothing to do with those of matching an image with a
scan, and it shows what such matches cannot: a wrong focal length together with a camera moved along its view predicts
other image motion. It is ours, not the paper's.
"""

from calibnet.motion.estimate import MotionPairs, motion_estimate

__all__ = ["MotionPairs", "motion_estimate"]
