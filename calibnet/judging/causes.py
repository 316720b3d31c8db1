"""Why image and scan do not fit: faults are undone one at a time, and the one without which they fit is the cause.

If the image is mirrored or rolled, or the scan uses other axes, hardly anything can be matched, so the match error of
a coarse stage shows whether undoing a fault helps. Every attempt runs the network again, so this is done for frames
that are not accepted and in `verify`, not for every frame. A wrong lens is recognised from the matches of the run
itself, see `calibnet.judging.lens_causes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

import cv2
import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.errors import CalibrationError
from calibnet.geometry import transform_points
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.trace import StageTrace
from calibnet.verdict import Cause

Measure = Callable[[Frame, Extrinsic], float]
"""How badly image and scan of a frame fit, from a guess; raises `CalibrationError` if nothing can be matched."""


@dataclass(frozen=True)
class Attempt:
    """A fault that a frame may have, and how to undo it.

    Attributes:
        names: names of the cause; two if the input cannot distinguish them.
        text: a sentence for the user.
        undo: returns the frame without the fault.
    """

    names: tuple[str, ...]
    text: str
    undo: Callable[[Frame], Frame]


@dataclass(frozen=True)
class Search:
    """Attempts that are compared by one measure.

    Attributes:
        attempts: faults to undo.
        share: an attempt is the cause only if it reduces the measure below this share of its original value,
        most: and below this value.
        unit: unit of the measure, for the evidence.
    """

    attempts: tuple[Attempt, ...]
    share: float
    most: float
    unit: str


def cause(
    search: Search, frame: Frame, guess: Extrinsic, measure: Measure, given: float | None = None
) -> tuple[Cause, ...]:
    """Undo one fault at a time, and name the one without which image and scan fit best, if they fit clearly better.

    Args:
        search: the attempts.
        frame: the original frame.
        guess: ``camera_from_lidar`` that the run started from.
        measure: how badly image and scan fit.
        given: the measure of the original frame, if it is known already.
    """

    def measured(altered: Frame) -> float:
        try:
            value = measure(altered, guess)
        except CalibrationError:
            return np.inf
        return np.inf if np.isnan(value) else value

    given = measured(frame) if given is None else given
    tried = [(measured(frame.changed(attempt.undo)), attempt) for attempt in search.attempts]
    least, best = min(tried, key=lambda pair: pair[0])
    if not least < search.share * given or not least < search.most:
        return ()
    before = "no plausible result" if np.isinf(given) else f"{given:.3g} {search.unit}"
    evidence = f"{least:.3g} {search.unit} without this fault, {before} with it"
    return tuple(Cause(name, best.text, evidence) for name in best.names)


class Looking(Protocol):
    """The part of `calibnet.cascade.stage.Stage` that attempts use."""

    def view(self, frame: Frame) -> Any:
        """The frame's image as the stage sees it."""
        ...

    def look(self, frame: Frame, view: Any, before: Extrinsic) -> StageTrace:
        """Correct an extrinsic once."""
        ...


def match_error_of(stage: Looking) -> Measure:
    """Geometric mean of the match errors, in pixels, that two successive looks of a stage expect."""

    def measure(frame: Frame, guess: Extrinsic) -> float:
        view = stage.view(frame)
        first = stage.look(frame, view, guess)
        second = stage.look(frame, view, first.after)
        return float(np.sqrt(first.match_error_px * second.match_error_px))

    return measure


def mirrored(frame: Frame) -> Frame:
    """The frame with left and right of its image exchanged."""
    return replace(frame, image=np.ascontiguousarray(frame.image[:, ::-1]))


def turned(degrees: float) -> Callable[[Frame], Frame]:
    """Rotate the image clockwise about its principal point."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

    def undo(frame: Frame) -> Frame:
        matrix, size = frame.camera.matrix, (frame.camera.width, frame.camera.height)
        image = cv2.warpPerspective(frame.image, matrix @ turn @ np.linalg.inv(matrix), size)
        return replace(frame, image=image.astype(np.uint8, copy=False))

    return undo


def scan_moved(motion: Transform) -> Callable[[Frame], Frame]:
    """Move the points of the scan by a transform, 4x4."""

    def undo(frame: Frame) -> Frame:
        positions = transform_points(motion, frame.points[:, :3].astype(np.float64))
        return replace(frame, points=np.column_stack([positions, frame.points[:, 3]]).astype(np.float32))

    return undo


def scan(rotation: Floats) -> Callable[[Frame], Frame]:
    """Rotate the points of the scan by ``rotation [3, 3]``."""

    def undo(frame: Frame) -> Frame:
        positions = frame.points[:, :3] @ rotation.T
        return replace(frame, points=np.column_stack([positions, frame.points[:, 3]]).astype(np.float32))

    return undo


def _image_and_scan() -> Iterator[Attempt]:
    yield Attempt(("mirrored", "left-handed"), "The image is mirrored, or the scan's axes are left-handed.", mirrored)
    for degrees in (-30, 30, -90, 90, 180):
        yield Attempt(("roll",), f"The image is rolled, by about {degrees:+d} degrees.", turned(-degrees))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for axes, rotation in (
        ("x right, y forward, z up", quarter.T),
        ("x left, y backward, z up", quarter),
        ("x backward, y right, z up", np.diag([-1.0, -1.0, 1.0])),
        ("x forward, y right, z down", np.diag([1.0, -1.0, -1.0])),
        ("x right, y down, z forward", np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])),
    ):
        text = (
            f"The scan's axes seem to be {axes}, where the extrinsic takes them for x forward, y left, z up; correct "
            "whichever is wrong."
        )
        yield Attempt(("axes",), text, scan(rotation))
    for axis, signs in (("x backward", [-1.0, 1.0, 1.0]), ("z down", [1.0, 1.0, -1.0])):
        text = f"The scan's axes are left-handed, with {axis}; they must be x forward, y left, z up."
        yield Attempt(("left-handed",), text, scan(np.diag(signs)))


IMAGE_AND_SCAN = Search(
    tuple(_image_and_scan()), share=0.6, most=18.0, unit="px of match error in the first stage's image"
)
"""Compared by the match error of a coarse stage. On 4 frames of 4 rigs, undoing a mirrored image or other axes cut
it to 0.13 to 0.5 of its value, undoing a rolled image to 0.3 to 0.6. For an image of another place the best attempt
reached 0.5 once, and otherwise 0.8 and more. Without the fault it is 8 to 12 px; for an image of another place 23."""
