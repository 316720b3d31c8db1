"""Reads the recording of a rig: the result of every camera and, on demand, its pictures."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from calibnet.geometry import CameraModel
from inspector import entities
from inspector.read.file import RecordingFile
from inspector.read.pictures import RecordedPictures
from inspector.read.tables import PROPERTIES, static_row
from inspector.read.understood import RecordingError, camera_of, extrinsic_of, understood
from inspector.read.verdict import read_verdict
from inspector.rig_result import CameraResult, Residual, RigResult


@dataclass(frozen=True, eq=False)
class RecordedRig:
    """The recording of a rig.

    Attributes:
        path: the recording's file.
        title: its title.
        settings: the options that identify the run.
        solved: the result.
        moments: numbers of the recorded frames, by camera.
    """

    path: Path
    title: str
    settings: dict[str, Any]
    solved: RigResult
    moments: dict[str, tuple[int, ...]]
    _file: RecordingFile = field(repr=False)

    def camera(self, name: str) -> CameraResult:
        """The result of a camera.

        Raises:
            RecordingError: there is no camera of this name.
        """
        for camera in self.solved.cameras:
            if camera.name == name:
                return camera
        names = ", ".join(camera.name for camera in self.solved.cameras)
        raise RecordingError(f"{self.path} has no camera {name!r}; choose from {names}.")

    def pictures(self, name: str) -> RecordedPictures:
        """The pictures of a camera."""
        return RecordedPictures(self._file, entities.camera_of_rig(name))


def is_rig(path: Path) -> bool:
    """Whether a file is the recording of a rig; all others are for `inspector.read.run.read_run` to read or refuse."""
    return _said(RecordingFile(path)) is not None


def read_rig(path: Path) -> RecordedRig:
    """Read everything but the pictures.

    Raises:
        RecordingError: the file is missing, damaged, foreign or not the recording of a rig.
    """
    file = RecordingFile(path)
    with understood(path):
        text = _said(file)
        if text is None:
            raise RecordingError(f"{path} is not a recording of a rig; `calib-inspect rig` makes one.")
        said = json.loads(text)
        cameras = tuple(_camera(name, one, path) for name, one in said["cameras"].items())
        if not cameras:
            raise ValueError("a rig without cameras")
        run = _static(file, f"{PROPERTIES}/{entities.RUN}")
        title = _static(file, PROPERTIES).get("RecordingInfo:name", [path.stem])[0]
        solved = RigResult(cameras, bool(said["rigid"]), str(said["tolerance"]))
        settings = {name: value[0] for name, value in run.items()}
        moments = {camera.name: _moments(file, camera.name) for camera in cameras}
    return RecordedRig(path, str(title), settings, solved, moments, file)


def _camera(name: str, said: dict[str, Any], path: Path) -> CameraResult:
    verdict = read_verdict(json.dumps(said["verdict"]), path)
    residual, reference = said["residual"], said["reference"]
    px = residual["match_error_px"]
    apart = [None if residual[key] is None else float(residual[key]) for key in ("rotation_deg", "translation_cm")]
    return CameraResult(
        str(name),
        _lens(said["camera"], path),
        verdict,
        extrinsic_of(said["initial"]),
        Residual(float("nan") if px is None else float(px), *apart),
        None if reference is None else extrinsic_of(reference),
    )


def _lens(said: dict[str, Any], path: Path) -> CameraModel:
    row = {
        "width": [said["width"]],
        "height": [said["height"]],
        "camera_matrix": said["matrix"],
        "lens_model": [said["model"]],
        "lens_coefficients": said["coefficients"],
    }
    return camera_of(row, path)


def _said(file: RecordingFile) -> str | None:
    """The JSON text of a rig; None for other recordings."""
    text = _static(file, entities.RIG).get(entities.RIG_JSON)
    return None if not text else str(text[0])


def _static(file: RecordingFile, entity: str) -> dict[str, list[Any]]:
    """The static data of an entity, as lists by component."""
    return static_row(chunk.to_record_batch() for chunk in file.chunks(entity))


def _moments(file: RecordingFile, name: str) -> tuple[int, ...]:
    """Numbers of the frames of which a camera has a picture."""
    frames: set[int] = set()
    for chunk in file.chunks(f"{entities.camera_of_rig(name)}/{entities.IMAGE}"):
        frames |= set(np.asarray(chunk.to_record_batch()[entities.FRAME]).tolist())
    return tuple(sorted(frames))
