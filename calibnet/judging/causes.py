"""Why picture and scan do not fit: whatever, done to what was given, makes them fit is the cause.

Each attempt undoes one fault. A mirrored or rolled picture and a scan in other axes keep the scan from being found in
the picture at all, so a coarse stage's match error tells. That needs the network again for every attempt, which is for
doubt and for `verify`, not for every frame. A wrong lens is told by the matches, see `calibnet.judging.lens_causes`.
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
from calibnet.judging.predictors import reach
from calibnet.trace import CascadeTrace, StageTrace
from calibnet.verdict import Cause

Measure = Callable[[Frame, Extrinsic], float]
"""How badly picture and scan of a frame fit, from a guess; raises `CalibrationError` where that cannot be told."""


@dataclass(frozen=True)
class Attempt:
    """A fault that a frame may have, and how to undo it.

    Attributes:
        names: of the causes; two where the picture cannot tell which.
        text: a sentence for the user.
        undo: of a frame.
    """

    names: tuple[str, ...]
    text: str
    undo: Callable[[Frame], Frame]


@dataclass(frozen=True)
class Search:
    """Attempts that are judged by one measure.

    Attributes:
        attempts: what is tried.
        share: of the measure with what was given, below which an attempt is the cause.
        most: that the measure may be with the fault undone.
        unit: of the measure, for the evidence.
    """

    attempts: tuple[Attempt, ...]
    share: float
    most: float
    unit: str


def cause(search: Search, frame: Frame, guess: Extrinsic, measure: Measure) -> tuple[Cause, ...]:
    """Undo every fault in turn, and name the one without which picture and scan fit best, if they fit clearly better.

    Args:
        search: what is tried.
        frame: as it was given.
        guess: ``camera_from_lidar`` that the run started from.
        measure: how badly they fit.
    """

    def measured(altered: Frame) -> float:
        try:
            value = measure(altered, guess)
        except CalibrationError:
            return np.inf
        return np.inf if np.isnan(value) else value

    given = measured(frame)
    tried = [(measured(frame.changed(attempt.undo)), attempt) for attempt in search.attempts]
    least, best = min(tried, key=lambda pair: pair[0])
    if not least < search.share * given or not least < search.most:
        return ()
    before = "no match at all" if np.isinf(given) else f"{given:.3g} {search.unit}"
    evidence = f"{least:.3g} {search.unit} with that undone, instead of {before}"
    return tuple(Cause(name, best.text, evidence) for name in best.names)


class Looking(Protocol):
    """What attempts need of a `calibnet.cascade.stage.Stage`."""

    def view(self, frame: Frame) -> Any:
        """The frame's image as the stage sees it."""
        ...

    def look(self, frame: Frame, view: Any, before: Extrinsic) -> StageTrace:
        """Correct an extrinsic once."""
        ...


def match_error_of(stage: Looking) -> Measure:
    """The geometric mean, in pixels, of what two looks of a stage expect, the second from where the first arrives."""

    def measure(frame: Frame, guess: Extrinsic) -> float:
        view = stage.view(frame)
        first = stage.look(frame, view, guess)
        second = stage.look(frame, view, first.after)
        return float(np.sqrt(first.match_error_px * second.match_error_px))

    return measure


def reach_of(calibrate: Callable[[Frame, Extrinsic], CascadeTrace]) -> Measure:
    """How far a run goes from the guess, in ranges searched; infinite where picture and scan do not fit there."""

    def measure(frame: Frame, guess: Extrinsic) -> float:
        trace = calibrate(frame, guess)
        first = trace.stages[0].range
        return reach(trace.initial, trace.stages[-1].after, first).share if trace.fits else np.inf

    return measure


def mirrored(frame: Frame) -> Frame:
    """The frame with left and right of its picture exchanged."""
    return replace(frame, image=np.ascontiguousarray(frame.image[:, ::-1]))


def turned(degrees: float) -> Callable[[Frame], Frame]:
    """Turn the picture clockwise about its principal point."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

    def undo(frame: Frame) -> Frame:
        matrix, size = frame.camera.matrix, (frame.camera.width, frame.camera.height)
        image = cv2.warpPerspective(frame.image, matrix @ turn @ np.linalg.inv(matrix), size)
        return replace(frame, image=image.astype(np.uint8, copy=False))

    return undo


def scan_moved(motion: Transform) -> Callable[[Frame], Frame]:
    """Take the scan's points after a motion, 4x4."""

    def undo(frame: Frame) -> Frame:
        positions = transform_points(motion, frame.points[:, :3].astype(np.float64))
        return replace(frame, points=np.column_stack([positions, frame.points[:, 3]]).astype(np.float32))

    return undo


def scan(rotation: Floats) -> Callable[[Frame], Frame]:
    """Take ``rotation [3, 3]`` of the scan's points."""

    def undo(frame: Frame) -> Frame:
        positions = frame.points[:, :3] @ rotation.T
        return replace(frame, points=np.column_stack([positions, frame.points[:, 3]]).astype(np.float32))

    return undo


def _picture_and_scan() -> Iterator[Attempt]:
    yield Attempt(("mirrored", "left-handed"), "The picture is mirrored, or the scan's axes are left-handed.", mirrored)
    for degrees in (-30, 30, -90, 90, 180):
        yield Attempt(("roll",), f"The picture is rolled, by about {degrees:+d} degrees.", turned(-degrees))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for axes, rotation in (
        ("x right, y forward, z up", quarter.T),
        ("x left, y backward, z up", quarter),
        ("x backward, y right, z up", np.diag([-1.0, -1.0, 1.0])),
        ("x forward, y right, z down", np.diag([1.0, -1.0, -1.0])),
        ("x right, y down, z forward", np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])),
    ):
        text = f"The scan's axes seem to be {axes}; they must be x forward, y left, z up."
        yield Attempt(("axes",), text, scan(rotation))
    for axis, signs in (("x backward", [-1.0, 1.0, 1.0]), ("z down", [1.0, 1.0, -1.0])):
        text = f"The scan's axes are left-handed, with {axis}; they must be x forward, y left, z up."
        yield Attempt(("left-handed",), text, scan(np.diag(signs)))


PICTURE_AND_SCAN = Search(tuple(_picture_and_scan()), share=0.6, most=18.0, unit="px of expected match error")
"""By the match error of a coarse stage. Of 4 frames of 4 rigs, a mirrored picture and other axes undone came to 0.13 to
0.5 of it, a rolled picture to 0.3 to 0.6; the best wrong attempt for a picture of another place to 0.5 once, and
otherwise to 0.8 and more. Undone they are 8 to 12 px; a picture of another place came to 23."""
