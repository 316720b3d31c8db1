"""Detects moves of the mount during a drive, even if they are so large that no single extrinsic fits all frames."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from calibnet.calibrator import DriveCalibrator
from calibnet.datasets.frame import Frame, Frames, index_of
from calibnet.drive.changes import SHORTEST, watch
from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry import RANGES
from calibnet.geometry.se3 import invert, pose_from_vector, pose_vector
from calibnet.geometry.types import Extrinsic
from calibnet.trace import DriveEstimate, DriveLook
from calibnet.verdict import BadFrame
from calibnet.watch import Watched

FEWEST = 2 * SHORTEST
"""Smallest number of frames of a drive that can be watched."""
TRUSTED = 0.6
"""Share of the finest stage's range within which one look measures a frame's distance from the drive's extrinsic."""
BLIND_DEG, BLIND_CM = 1.0, 50.0
"""Largest random difference between two windows of frames (three standard deviations) at which changes can be
detected."""


class Part:
    """Consecutive frames of a drive, from ``start`` to before ``stop``."""

    def __init__(self, frames: Frames, start: int, stop: int) -> None:
        self.frames, self.start, self.stop = frames, start, stop

    def __len__(self) -> int:
        return self.stop - self.start

    def index_of(self, position: int) -> int:
        """The number of a frame."""
        return index_of(self.frames, self.start + position)

    def __getitem__(self, position: int, /) -> Frame:
        """Read one frame."""
        return self.frames[self.start + position]


@dataclass(frozen=True, eq=False)
class SolvedPart:
    """A part of a drive and its solution."""

    part: Part
    estimate: DriveEstimate

    @property
    def origin(self) -> Extrinsic:
        """Extrinsic to which its looks are relative."""
        looked_from = self.estimate.looked_from
        return self.estimate.camera_from_lidar if looked_from is None else looked_from

    def relative_to(self, origin: Extrinsic) -> list[DriveLook]:
        """Its looks relative to another extrinsic, with positions in the whole drive."""
        base = self.origin @ invert(origin)
        return [
            replace(
                look,
                position=self.part.start + look.position,
                offset=pose_vector(pose_from_vector(look.offset) @ base),
            )
            for look in self.estimate.looks
        ]


def watch_drive(
    calibrator: DriveCalibrator,
    frames: Frames,
    initial: Extrinsic,
    observer: Callable[[int, int], None] | None = None,
) -> Watched:
    """Detect moves of the mount during a drive.

    The drive is solved as one. Parts for which that fails, and parts that turn out to be far from the rest, are solved
    by themselves, so that moves beyond the range of the last stage are measured too.

    Args:
        calibrator: method that solves drives and returns looks.
        frames: frames in the order in which they were taken.
        initial: ``camera_from_lidar`` to start from.
        observer: as for `calibnet.drive.solve.solve_drive`, for one part after the other.
    """
    if len(frames) < FEWEST:
        return Watched(None, None, f"{len(frames)} frames are too few to detect a change; {FEWEST} are needed.", 0)
    parts = solved_parts(calibrator, Part(frames, 0, len(frames)), initial, observer)
    if not parts:
        return Watched(None, None, "Image and scan do not fit together in any part of the drive.", 0)
    origin = max(parts, key=lambda part: part.estimate.frames).origin
    looks = {look.position: look for part in parts for look in part.relative_to(origin)}
    again = far_parts(calibrator, frames, looks, origin, observer)
    looks |= {look.position: look for part in again for look in part.relative_to(origin)}
    skipped = [bad for part in parts for bad in part.estimate.skipped]
    return judge_looks(looks, len(frames), origin, skipped)


def watch_estimate(estimate: DriveEstimate, count: int) -> Watched:
    """Detect moves in a drive of ``count`` frames that is already solved, without further computation.

    Moves beyond the range of the last stage are detected but not measured, and parts that do not fit are ignored.
    """
    origin = estimate.camera_from_lidar if estimate.looked_from is None else estimate.looked_from
    return judge_looks({look.position: look for look in estimate.looks}, count, origin, estimate.skipped)


def judge_looks(looks: dict[int, DriveLook], count: int, origin: Extrinsic, skipped: Iterable[BadFrame]) -> Watched:
    """Detect changes over a drive from its looks, if these suffice.

    Args:
        looks: looks relative to ``origin``, by position.
        count: number of the drive's frames.
        origin: ``camera_from_lidar``, 4x4.
        skipped: frames that do not fit or could not be read.
    """
    in_order = [looks[position] for position in sorted(looks)]
    known = {look.frame for look in in_order}
    missing = tuple(bad for bad in skipped if bad.frame not in known)
    if len(in_order) < max(FEWEST, (count + 1) // 2):
        reason = f"Only {len(in_order)} of {count} frames can be read and fit."
        return Watched(origin, None, reason, len(in_order), missing)
    found = watch(in_order)
    blind = 3 * found.smallest
    turn, shift = float(np.degrees(np.linalg.norm(blind[3:]))), float(100 * np.linalg.norm(blind[:3]))
    if not found.changes and (turn > BLIND_DEG or shift > BLIND_CM):
        reason = f"Frames scatter so much that a move of {turn:.1f}° or {shift:.0f} cm could not be detected."
        return Watched(origin, found, reason, len(in_order), missing)
    return Watched(origin, found, "", len(in_order), missing)


def solved_parts(
    calibrator: DriveCalibrator, part: Part, initial: Extrinsic, observer: Callable[[int, int], None] | None
) -> list[SolvedPart]:
    """Solve a drive as one, or its halves if half of its frames do not fit together, down to `SHORTEST` frames."""
    try:
        solved = SolvedPart(part, calibrator.calibrate_drive(part, initial, observer))
        if 2 * solved.estimate.frames > len(part) or len(part) < FEWEST:
            return [solved]
    except (CalibrationError, DatasetError):
        if len(part) < FEWEST:
            return []
    middle = (part.start + part.stop) // 2
    halves = (Part(part.frames, part.start, middle), Part(part.frames, middle, part.stop))
    return [found for half in halves for found in solved_parts(calibrator, half, initial, observer)]


def far_parts(
    calibrator: DriveCalibrator,
    frames: Frames,
    looks: dict[int, DriveLook],
    origin: Extrinsic,
    observer: Callable[[int, int], None] | None,
) -> list[SolvedPart]:
    """Solve by themselves the parts between changes that are far from the extrinsic of all, or do not fit it.

    Args:
        calibrator: method that solves them.
        frames: frames of the drive.
        looks: looks so far, by position.
        origin: extrinsic to which looks are relative.
        observer: as for `watch_drive`.
    """
    if len(looks) < FEWEST:
        return []
    places = {look.frame: position for position, look in looks.items()}
    found = watch([looks[position] for position in sorted(looks)])
    borders = {0, len(frames), *(places[change.frame] for change in found.changes if change.until is None)}
    for lost in consecutive_runs([position for position in range(len(frames)) if position not in looks]):
        borders |= set(lost) if lost[1] - lost[0] >= SHORTEST else set()
    solved = []
    for start, stop in pairwise(sorted(borders)):
        offsets = [looks[position].offset for position in range(start, stop) if position in looks]
        middle = pose_from_vector(np.median(offsets, axis=0)) if offsets else np.eye(4)
        near = RANGES[-1].contains(middle, TRUSTED) and 2 * len(offsets) >= stop - start
        if near or stop - start < SHORTEST:
            continue
        part = Part(frames, start, stop)
        with contextlib.suppress(CalibrationError, DatasetError):  # frames that do not fit stay skipped
            solved.append(SolvedPart(part, calibrator.calibrate_drive(part, middle @ origin, observer)))
    return solved


def consecutive_runs(positions: list[int]) -> list[tuple[int, int]]:
    """Runs of consecutive positions, each as its first position and the one after its last."""
    found: list[tuple[int, int]] = []
    for position in positions:
        if found and found[-1][1] == position:
            found[-1] = (found[-1][0], position + 1)
        else:
            found.append((position, position + 1))
    return found
