"""The result of a rig, camera by camera: for the terminal, the viewer, JSON, recordings and other tools."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from calibnet.geometry import CameraModel, PoseError, degrees_and_cm, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED, Verdict, Word
from inspector.markdown import markdown_table
from inspector.verdicts import explained

COLUMNS = (
    "camera",
    "verdict",
    "off the reference",
    "uncertainty (1σ)",
    "vs camera alone",
    "corrected by",
    "match error",
)
"""Columns of the table with a row per camera, the most important first."""
VIEWED = 5
"""Number of its columns that the viewer has room for; reports have all."""


class Residual(NamedTuple):
    """Residuals of a camera.

    Attributes:
        match_error_px: median error that its last look expects of its matches, in pixels of the camera's images; NaN
            where unknown.
        rotation_deg: angle between the rig's result and that of this camera's own frames; None if solved alone.
        translation_cm: distance between the two, likewise.
    """

    match_error_px: float = math.nan
    rotation_deg: float | None = None
    translation_cm: float | None = None

    def as_dict(self) -> dict[str, float | None]:
        """The JSON object."""
        return self._asdict() | {"match_error_px": None if math.isnan(self.match_error_px) else self.match_error_px}


@dataclass(frozen=True, eq=False)
class CameraResult:
    """The result of one camera.

    Attributes:
        name: the camera's name.
        camera: the camera itself, lens included.
        verdict: verdict on the result, with the extrinsic.
        initial: initial ``camera_from_lidar``.
        residual: its residuals.
        reference: the true ``camera_from_lidar``; None where unknown.
    """

    name: str
    camera: CameraModel
    verdict: Verdict
    initial: Extrinsic = field(repr=False)
    residual: Residual = field(default_factory=Residual)
    reference: Extrinsic | None = field(default=None, repr=False)

    @property
    def error(self) -> PoseError | None:
        """Error of the result; None without a reference."""
        return None if self.reference is None else pose_error(self.verdict.camera_from_lidar, self.reference)

    def line(self) -> str:
        """The result in a sentence, for the terminal."""
        turned, shifted = self.verdict.moved
        said = f"{self.name}: {self.verdict.word}, corrected by {degrees_and_cm(turned, shifted)}"
        if self.verdict.covariance is not None:
            said += f", ±{degrees_and_cm(self.verdict.sigma_rotation_deg, self.verdict.sigma_translation_cm)} (1σ)"
        if self.residual.rotation_deg is not None:
            alone = degrees_and_cm(self.residual.rotation_deg, self.residual.translation_cm)
            said += f", {alone} from the result of its own frames"
        if self.error is not None:
            said += f", off the reference by {degrees_and_cm(self.error.rotation_deg, self.error.translation_cm)}"
        return f"{said}." if self.verdict.word == ACCEPTED else f"{said}. {explained(self.verdict)}"

    def row(self) -> list[str]:
        """The cells of its row, by `COLUMNS`; empty where a value is missing."""
        turned, shifted = self.verdict.moved
        residual = self.residual
        sure = degrees_and_cm(self.verdict.sigma_rotation_deg, self.verdict.sigma_translation_cm)
        off = "" if self.error is None else degrees_and_cm(self.error.rotation_deg, self.error.translation_cm)
        alone = degrees_and_cm(residual.rotation_deg, residual.translation_cm)
        px = "" if math.isnan(residual.match_error_px) else f"{residual.match_error_px:.1f} px"
        return [self.name, self.verdict.word, off, sure, alone, degrees_and_cm(turned, shifted), px]

    def recorded(self) -> dict[str, Any]:
        """The JSON object that a recording keeps."""
        camera = self.camera
        return {
            "verdict": self.verdict.as_dict(),
            "initial": self.initial.tolist(),
            "reference": None if self.reference is None else self.reference.tolist(),
            "residual": self.residual.as_dict(),
            "camera": {
                "width": camera.width,
                "height": camera.height,
                "matrix": camera.matrix.ravel().tolist(),
                "model": camera.model,
                "coefficients": camera.coefficients.tolist(),
            },
        }


@dataclass(frozen=True)
class RigResult:
    """The result of all cameras of a rig.

    Attributes:
        cameras: results of the cameras, in order.
        rigid: whether they were solved as one rigid rig.
        tolerance: standard deviation allowed for each camera's place on the rig, as given; empty for none.
    """

    cameras: tuple[CameraResult, ...]
    rigid: bool
    tolerance: str = ""

    @property
    def how(self) -> str:
        """How the cameras were solved, in words."""
        if self.tolerance:
            return f"as one rig, each ±{self.tolerance} (1σ) about its place on it"
        return "as one rigid rig" if self.rigid else "one by one"

    @property
    def not_rejected(self) -> Iterator[CameraResult]:
        """The cameras whose results are not rejected."""
        return (camera for camera in self.cameras if camera.verdict.word != REJECTED)

    @property
    def word(self) -> Word:
        """Accepted if all cameras are, rejected if one is, else cannot tell."""
        words = {camera.verdict.word for camera in self.cameras}
        return REJECTED if REJECTED in words else CANNOT_TELL if CANNOT_TELL in words else ACCEPTED

    def lines(self) -> Iterator[str]:
        """Sentences for the terminal, of which the last is the verdict on the rig."""
        yield from (camera.line() for camera in self.cameras)
        yield f"Verdict: {self.word} ({len(self.cameras)} cameras, solved {self.how})."

    @property
    def headline(self) -> str:
        """How the cameras were solved, and their largest error or, without a reference, their largest correction."""
        said = f"{len(self.cameras)} cameras, solved {self.how}"
        errors = [camera.error for camera in self.cameras if camera.error is not None]
        if len(errors) == len(self.cameras):
            far = max(error.rotation_deg for error in errors), max(error.translation_cm for error in errors)
            return f"{said}: {degrees_and_cm(far[0], far[1])} off the reference{self._at_most}."
        turned, shifted = (max(camera.verdict.moved[i] for camera in self.cameras) for i in (0, 1))
        return f"{said}: corrected by {degrees_and_cm(turned, shifted)}{self._at_most}."

    @property
    def _at_most(self) -> str:
        return "" if self.rigid and not self.tolerance else " at most"

    @property
    def short_names(self) -> list[str]:
        """The cameras' names without the words at their start that all share."""
        names = [camera.name for camera in self.cameras]
        alike = next((place for place, letters in enumerate(zip(*names, strict=False)) if len(set(letters)) > 1), 0)
        words = max(names[0].rfind(mark, 0, alike) for mark in "-_. ") + 1
        return [name[words:] for name in names]

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Headings of the columns that are not empty, and a row per camera, by its short name."""
        rows = [camera.row() for camera in self.cameras]
        kept = [column for column in range(len(COLUMNS)) if any(row[column] for row in rows)]
        for row, name in zip(rows, self.short_names, strict=True):
            row[0] = name
        return [COLUMNS[column] for column in kept], [[row[column] for column in kept] for row in rows]

    def markdown(self) -> Iterator[str]:
        """The verdict and a table, for the viewer."""
        yield from (f"# {self.word.capitalize()}", "", self.headline, "")
        reasons = [*dict.fromkeys(explained(camera.verdict) for camera in self.cameras)]
        if len(reasons) == 1:  # one that holds for all belongs to the word; several are read beside the table
            yield from (reasons.pop(), "")
        headings, rows = self.table()
        yield from markdown_table(headings[:VIEWED], [row[:VIEWED] for row in rows])
        yield ""
        for reason in reasons:
            yield from (reason, "")

    def as_dict(self) -> dict[str, object]:
        """The JSON object: ``cameras`` by name, each with its `Verdict.as_dict` and residuals."""
        cameras = {
            camera.name: camera.verdict.as_dict() | {"residual": camera.residual.as_dict()} for camera in self.cameras
        }
        return {"verdict": self.word, "rigid": self.rigid, "tolerance": self.tolerance or None, "cameras": cameras}

    def recorded(self) -> dict[str, Any]:
        """The JSON object that a recording keeps; `inspector.read.rig` reads it."""
        cameras = {camera.name: camera.recorded() for camera in self.cameras}
        return {"rigid": self.rigid, "tolerance": self.tolerance, "cameras": cameras}
