"""Turns the image upright if the camera is mounted on its side, upside down or at any other roll.

The networks were trained on upright images. The initial extrinsic gives the roll, since the LiDAR's z axis points up.
The image is turned about its principal point, which is a pure rotation of the camera and loses nothing; results of the
stages are turned back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.drive.rig import CameraEstimate
from calibnet.geometry import MiscalibrationRange, PinholeCamera, transform
from calibnet.geometry.se3 import rotation_from_vector
from calibnet.geometry.types import Extrinsic, Rotation
from calibnet.trace import CascadeTrace, DriveEstimate, StageTrace
from calibnet.verdict import Verdict

AnyResult = TypeVar("AnyResult", StageTrace, Verdict, DriveEstimate, CameraEstimate)

TOLERATED_DEG = 8.0
"""Largest roll in degrees that is left as it is, as in training, since turning an image loses its corners."""
BEYOND_RANGE_DEG = 3.0
"""Degrees by which a roll must exceed the range searched to be taken for that of the mount rather than an error."""
LEVEL = 0.5
"""Length of an upward unit vector in the image plane below which the camera looks up or down and has no roll."""
QUARTER = np.pi / 2
QUARTER_TURN: Rotation = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
FILLED = 1 / 3
"""Smallest share of filled pixels of a row or column at the border of a turned image, relative to the fullest."""


@dataclass(frozen=True)
class Upright:
    """Rotation of a camera about its optical axis that makes it upright, which is none for most.

    Attributes:
        quarters: quarter turns, clockwise in the image, which are exact.
        rest: further clockwise rotation in radians, for which the image is resampled.
    """

    quarters: int = 0
    rest: float = 0.0

    @classmethod
    def of(cls, camera_from_lidar: Extrinsic, searched: MiscalibrationRange) -> Upright:
        """The rotation for a guess of the extrinsic, which may be wrong by the range that is searched."""
        turn = -roll_of(camera_from_lidar)
        quarters = round(turn / QUARTER)
        rest = turn - quarters * QUARTER
        tolerated = np.radians(max(TOLERATED_DEG, searched.rotation_deg + BEYOND_RANGE_DEG))
        return cls(quarters, rest if abs(rest) > tolerated else 0.0)

    def __bool__(self) -> bool:
        """Whether the image is turned at all."""
        return bool(self.quarters or self.rest)

    @cached_property
    def rotation(self) -> Rotation:
        """``[3, 3]``, rotation from the real to the upright camera."""
        quarter = np.linalg.matrix_power(QUARTER_TURN, self.quarters % 4)
        return rotation_from_vector([0.0, 0.0, self.rest]) @ quarter

    def extrinsic(self, camera_from_lidar: Extrinsic) -> Extrinsic:
        """An extrinsic of the real camera as that of the upright one."""
        return transform(self.rotation, np.zeros(3)) @ camera_from_lidar if self else camera_from_lidar

    def frame(self, frame: Frame) -> Frame:
        """A frame as taken by the upright camera."""
        if not self:
            return frame
        image, camera = turned_by_quarters(frame.image, frame.camera, self.quarters % 4)
        if self.rest:
            image, camera = turned(image, camera, rotation_from_vector([0.0, 0.0, self.rest]))
        faces = tuple(
            face._replace(face_from_camera=face.face_from_camera @ self.rotation.T) for face in frame.faces
        )  # faces are level already
        extrinsic = self.extrinsic(frame.camera_from_lidar)
        return replace(frame, image=image, camera=camera, camera_from_lidar=extrinsic, faces=faces)

    def undo(self, trace: CascadeTrace, initial: Extrinsic) -> CascadeTrace:
        """The trace of a run on the upright frame, as one on the real frame that started from ``initial``."""
        if not self:
            return trace
        stages, wider = (tuple(map(self.real, part)) for part in (trace.stages, trace.wider))
        verdict = None if trace.verdict is None else self.real(trace.verdict)
        return replace(trace, initial=initial, stages=stages, wider=wider, verdict=verdict)

    def real(self, result: AnyResult) -> AnyResult:
        """A result for the upright camera as one for the real camera."""
        return result.rotated(self.rotation.T) if self else result


def roll_of(camera_from_lidar: Extrinsic) -> float:
    """Radians by which upright objects lean clockwise in the image; 0 if the camera looks up or down."""
    right, down = camera_from_lidar[:2, 2]  # image coordinates of the LiDAR's upward axis
    return float(np.arctan2(right, -down)) if np.hypot(right, down) >= LEVEL else 0.0


def turned_by_quarters(
    image: NDArray[np.uint8], camera: PinholeCamera, quarters: int
) -> tuple[NDArray[np.uint8], PinholeCamera]:
    """Turn an image ``[H, W, 3]`` and its camera clockwise by quarter turns."""
    matrix, width, height = camera.matrix, camera.width, camera.height
    for _ in range(quarters):
        pixels = np.array([[0.0, -1.0, height - 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        matrix, width, height = pixels @ matrix @ QUARTER_TURN.T, height, width
    return np.ascontiguousarray(np.rot90(image, -quarters)), PinholeCamera(width, height, matrix)


def turned(
    image: NDArray[np.uint8], camera: PinholeCamera, rotation: Rotation
) -> tuple[NDArray[np.uint8], PinholeCamera]:
    """An image ``[H, W, 3]`` and its camera, turned about the camera's centre.

    A turned image is tilted within a larger, partly empty, upright frame, of which the mostly filled part is kept.
    Outside its border the image is continued, since any other border would be an edge.
    """
    homography = camera.matrix @ rotation @ np.linalg.inv(camera.matrix)
    right, bottom = camera.width - 0.5, camera.height - 0.5
    corners = homography @ np.array([[-0.5, right, right, -0.5], [-0.5, -0.5, bottom, bottom], [1.0, 1.0, 1.0, 1.0]])
    left, top = np.ceil((corners[:2] / corners[2]).min(axis=1)).astype(int).tolist()
    right, bottom = np.floor((corners[:2] / corners[2]).max(axis=1)).astype(int).tolist()

    def warped(image: NDArray[np.uint8], columns: range, rows: range, border: int) -> NDArray[np.uint8]:
        moved = np.array([[1.0, 0.0, -columns.start], [0.0, 1.0, -rows.start], [0.0, 0.0, 1.0]]) @ homography
        warped = cv2.warpPerspective(image, moved, (len(columns), len(rows)), borderMode=border)
        return warped.astype(np.uint8, copy=False)

    columns, rows = range(left, right + 1), range(top, bottom + 1)
    filled = warped(np.asarray(image.any(axis=2), np.uint8), columns, rows, cv2.BORDER_CONSTANT)
    middle = mostly(filled.sum(axis=1))
    rows, columns = rows[middle], columns[mostly(filled[middle].sum(axis=0))]
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= columns.start, rows.start
    return warped(image, columns, rows, cv2.BORDER_REPLICATE), PinholeCamera(len(columns), len(rows), matrix)


def mostly(filled: NDArray[np.integer]) -> slice:
    """The range of rows, or columns, from the first to the last one that is filled relative to the fullest."""
    full = np.flatnonzero(filled >= FILLED * filled.max())
    return slice(int(full[0]), int(full[-1]) + 1)
