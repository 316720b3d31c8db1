"""Scans that are later or earlier than their images, recognised by the motion of the car from scan to scan.

A late scan shows the world from where the car is by then. Matches explain this by a camera farther back, or by another
focal length, and they fit: nothing in one frame contradicts them. But if the scan is moved back by the car's own
motion, which registering two scans gives, the result lies near the guess again, and the matches indicate no fault of
the lens. A fault of the lens stays when the scan is moved, which distinguishes the two.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from calibnet.datasets.frame import Frame, Frames
from calibnet.errors import DatasetError
from calibnet.geometry.se3 import invert, pose_from_vector, pose_vector
from calibnet.geometry.types import Extrinsic, Transform
from calibnet.judging.causes import Attempt, Measure, Search, scan_moved
from calibnet.judging.lens_causes import LensOdds
from calibnet.judging.lens_predictors import lens_fits, lens_predictors
from calibnet.judging.predictors import reach
from calibnet.motion.odometry import registered
from calibnet.trace import MARGIN, CascadeTrace

STANDING_M = 0.1
"""Motion between scans below which a lag makes no difference."""
SHARES = (1.0, 0.5)
"""Lags that are tried, as shares of the time between two scans."""
SHARE = 0.6
"""See `calibnet.judging.causes.Search`. Without its lag, a scan that was 0.1 to 0.3 s late ended at 0.2 to 0.55 of its
former distance from the guess; a start outside the range stayed at 0.8 and more, whatever lag was undone."""
NO_FAULT = 0.5
"""Least probability that the lens has no fault, once the lag is undone (docs/decisions.md, "Rejecting")."""


def lags(frames: Frames, position: int) -> Search | None:
    """Attempts to undo a time lag of the scan of one frame, by the motion to the scans before and after it.

    Args:
        frames: of the drive, in the order in which they were taken.
        position: of the frame.

    Returns:
        Attempts whose measure is `reach_of`; None if there is no neighbour or no motion.
    """
    beside = {step: _motion(frames, position, step) for step in (-1, 1)}
    attempts: list[Attempt] = []
    for step, word in ((-1, "later"), (1, "earlier")):
        motion, seconds = beside[step] or _backwards(beside[-step])
        if motion is not None and np.linalg.norm(motion[:3, 3]) >= STANDING_M:
            attempts += [_attempt(motion, share, seconds, word) for share in SHARES]
    return Search(tuple(attempts), SHARE, MARGIN, "of the range from the guess") if attempts else None


def reach_of(calibrate: Callable[[Frame, Extrinsic], CascadeTrace], odds: LensOdds | None = None) -> Measure:
    """How far a run moves from the guess, relative to the range searched.

    Args:
        calibrate: makes the run.
        odds: of faults of the lens; None if they cannot be told.

    Returns:
        The measure. It is infinite if image and scan do not fit, or if the matches rather indicate a fault of the
        lens than none: then a lag does not explain them.
    """

    def measure(frame: Frame, guess: Extrinsic) -> float:
        trace = calibrate(frame, guess)
        looks = lens_fits(trace) if odds else None
        faults = odds(lens_predictors(looks)) if odds and looks else {}
        if not trace.fits or 1 - sum(faults.values()) < NO_FAULT:
            return np.inf
        return reach(trace.initial, trace.stages[-1].after, trace.stages[0].range).share

    return measure


Motion = tuple[Transform | None, float]
"""The motion from one scan to another, and the seconds between them."""


def _motion(frames: Frames, position: int, step: int) -> Motion | None:
    """The motion to the scan ``step`` frames on; None if there is none or registration fails."""
    if not 0 <= position + step < len(frames):
        return None
    try:
        here, there = frames[position], frames[position + step]
    except DatasetError:  # an unreadable neighbour tells nothing
        return None
    motion = registered(here.points, there.points)
    return None if motion is None else (motion, abs(there.timestamp - here.timestamp))


def _backwards(motion: Motion | None) -> Motion:
    """The motion to the scan on the other side, at constant velocity."""
    if motion is None or motion[0] is None:
        return None, 0.0
    return invert(motion[0]), motion[1]


def _attempt(motion: Transform, share: float, seconds: float, word: str) -> Attempt:
    moved = pose_from_vector(share * pose_vector(motion))
    by = f"{share * seconds:.2g} s" if seconds > 0 else f"{share:g} of a frame"
    text = f"Scans seem {by} {word} than their images: the car moves {np.linalg.norm(moved[:3, 3]):.1f} m in that time."
    return Attempt(("time-offset",), text, scan_moved(moved))
