"""The record of a run of the cascade or another method on a frame or a drive.

Recordings, reports and tables are made from these types alone. Arrays are NumPy, so that readers need no torch. Pixels
are those of a stage's input camera (`StageTrace.camera`), whose image is the frame's, resized and, if the camera is
rolled, turned upright.
"""

from calibnet.trace.drives import DriveEstimate, DriveLook, Estimate, LensReading, MotionEstimate
from calibnet.trace.frames import MARGIN, CascadeTrace, Matches, ScaleTrace, StageDetail, StageTrace

__all__ = [
    "MARGIN",
    "CascadeTrace",
    "DriveEstimate",
    "DriveLook",
    "Estimate",
    "LensReading",
    "Matches",
    "MotionEstimate",
    "ScaleTrace",
    "StageDetail",
    "StageTrace",
]
