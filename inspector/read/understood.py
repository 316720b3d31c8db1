"""Checks the content of a recording, which must be what a run can have written; anything else is an error of ours.

Recordings come from anybody, and Rerun's file format allows any content under the names that are read.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Len

from calibnet.datasets.images.files import MOST_PIXELS
from calibnet.errors import CalibnetError
from calibnet.geometry import CameraModel
from calibnet.geometry.camera_model import LensModel
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.schema import validated
from calibnet.runtime.text import one_line

LARGEST = 1e6
"""Largest entry of a camera matrix in pixels, and of an extrinsic in metres."""
RIGID_TOLERANCE = 1e-2
"""Largest entry of ``R^T R - I`` of an extrinsic; runs in single precision stay far below."""
Number = Annotated[float, Interval(ge=-LARGEST, le=LARGEST)]
Side = Annotated[int, Interval(ge=1, le=65_535)]


class RecordingError(CalibnetError):
    """A recording is missing, damaged, foreign, or without what a command needs of it."""


@contextmanager
def understood(path: Path) -> Iterator[None]:
    """A context that turns every error in a recording's content into a `RecordingError` that names the file."""
    try:
        yield
    except (CalibnetError, MemoryError):
        raise
    except Exception as error:
        raise _not_ours(path, error) from None
    except BaseException as error:
        if is_panic(error):
            raise _not_ours(path, error) from None
        raise


def is_panic(error: BaseException) -> bool:
    """Whether the error is a panic of Rust code, which is not an ``Exception`` in Python."""
    return type(error).__name__ == "PanicException"


@dataclass(frozen=True)
class _Camera:
    width: Side
    height: Side
    matrix: Annotated[tuple[Number, ...], Len(9, 9)]
    model: LensModel
    coefficients: Annotated[tuple[Number, ...], Len(0, 14)]


def camera_of(row: dict[str, Any], path: Path) -> CameraModel:
    """The camera of a frame; earlier recordings have rectified images and no lens.

    Raises:
        RecordingError: the row is not a valid camera.
    """
    said = {
        "width": row["width"][0],
        "height": row["height"][0],
        "matrix": list(row["camera_matrix"]),
        "model": row["lens_model"][0] if row.get("lens_model") else "plumb_bob",
        "coefficients": list(row["lens_coefficients"]) if row.get("lens_model") else [0.0] * 5,
    }
    camera = validated(_Camera, said, f"{path}: a camera", RecordingError, "record it again")
    matrix = np.reshape(camera.matrix, (3, 3))
    if camera.width * camera.height > MOST_PIXELS or not (matrix[0, 0] > 0 and matrix[1, 1] > 0):
        raise RecordingError(f"{path} has an invalid camera; record it again.")
    return CameraModel(camera.width, camera.height, matrix, camera.model, np.array(camera.coefficients))


def extrinsic_of(values: Any) -> Extrinsic:
    """A 4x4 extrinsic.

    Raises:
        ValueError: it is not a rigid transform of plausible size.
    """
    matrix = np.reshape(np.asarray(values, dtype=np.float64), (4, 4))
    rotation = matrix[:3, :3]
    if not (np.abs(matrix) < LARGEST).all() or np.abs(rotation.T @ rotation - np.eye(3)).max() > RIGID_TOLERANCE:
        raise ValueError("an extrinsic is not a rigid transform")
    return matrix


def _not_ours(path: Path, error: BaseException) -> RecordingError:
    what = one_line(f"{type(error).__name__}: {error}", 160)
    return RecordingError(f"{path} has content that calib-inspect does not write ({what}); record it again.")
