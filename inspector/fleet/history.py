"""The history of a car from all its drives: where the mount was, when it moved, and how good each calibration was.

A single drive often cannot tell; all drives of a car between two moves of its mount can (`calibnet.judging.mount`).
Their common result is compared with the calibration that each came with, as `verify` does for one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby, pairwise

import numpy as np

from calibnet.geometry.types import Floats
from calibnet.judging.mount import FEWEST, Finding, Mount, Stay, difference, excess_of, mount_over
from calibnet.judging.verify import DRIVE, verify
from calibnet.verdict import ACCEPTED, APART, CANNOT_TELL, REJECTED, Verdict
from inspector.fleet.table import FAILED, ByCar, Row

SCATTERED = 3.0
"""Largest scatter of a drive's frames, relative to that of the car's other drives."""
WHY = "the mount may have moved during the drive, or scans and images may not belong together."


@dataclass(frozen=True)
class Move:
    """A move of a mount.

    Attributes:
        before, after: the last drive before the move, and the first one after it.
        rotation_deg, translation_cm: size of the move.
        drives: number of drives from this move to the next.
        certain: whether enough drives agree on either side, or one is sufficient by itself.
    """

    before: Row
    after: Row
    rotation_deg: float
    translation_cm: float
    drives: int = 1
    certain: bool = True

    def __str__(self) -> str:
        between = f"between {_when(self.before)} and {_when(self.after)}"
        far = f"by {self.rotation_deg:.2f}° / {self.translation_cm:.0f} cm"
        if self.certain:
            return f"The mount moved {between}, {far}."
        return f"The mount seems to have moved {between}, {far}; more drives are needed to be sure."


@dataclass(frozen=True)
class History:
    """The drives of one camera of a car, and the positions of its mount.

    Attributes:
        car, camera: names of both.
        rows: all drives, in order.
        told: drives that say where the mount was.
        mount: positions of the mount, by index into ``told``.
    """

    car: str
    camera: str
    rows: tuple[Row, ...]
    told: tuple[Row, ...] = ()
    mount: Mount = field(default_factory=Mount)

    @property
    def name(self) -> str:
        """Name for pages."""
        return f"{self.car}, camera {self.camera}" if self.camera else self.car

    @property
    def moves(self) -> tuple[Move, ...]:
        """Moves of the mount, in order."""
        return tuple(self._moves())

    @property
    def sentence(self) -> str:
        """The history in a sentence or two."""
        moves = self.moves
        parts = [str(move) for move in moves]
        wrong = [row for row in self.rows if row.verdict == REJECTED and row.cause]
        off = [row for row in self.rows if row.word == REJECTED and not row.cause]
        failed = [row for row in self.rows if row.verdict == FAILED]
        apart = [row for row in self.rows if row.by_car == APART]
        if wrong:
            causes = ", ".join(dict.fromkeys(row.cause for row in wrong))
            parts.append(f"{_drives(len(wrong))} with wrong input ({causes}).")
        if off:
            same = ", by the same amount on all" if len(off) > 1 and not moves else ""
            parts.append(f"The calibration is off on {_drives(len(off))}{same}.")
        if apart:
            parts.append(f"{_named(apart)} {'is an outlier' if len(apart) == 1 else 'are outliers'}.")
        if failed:
            parts.append(f"{_drives(len(failed))} failed.")
        if not parts and not any(row.word in (ACCEPTED, REJECTED) for row in self.rows):
            parts.append("No drive is conclusive.")
        return " ".join(parts) or "The mount did not move."

    @cached_property
    def judged(self) -> tuple[Row, ...]:
        """Its drives, each with the verdict of all of them on the calibration that it came with."""
        suspect = 2 * sum(bool(row.cause) for row in self.rows) > len(self.rows)
        places = {row.folder: at for at, row in enumerate(self.told)}
        return tuple(
            self._judged(row, places[row.folder], suspect) if row.folder in places else _with(row) for row in self.rows
        )

    def _judged(self, row: Row, at: int, suspect: bool) -> Row:
        """The drive at an index into `told`; ``suspect`` if most drives of the car have wrong input."""
        if ratio := self._scatter(row):
            return _with(
                row, APART, f"Its frames scatter {ratio:.0f} times as much as those of the other drives: {WHY}"
            )
        firm = [stay for stay in self.mount.stays if stay.is_firm]
        stay = self.mount.stay_of(at)
        if not firm:
            return _with(row)
        if stay is None or not stay.is_firm:
            near = min(firm, key=lambda one: min(abs(member - at) for member in one.members))
            turn, shift = difference(near, _alone(row))
            others = f"{len(near.members)} other drives find the mount {turn:.2f}° / {shift:.0f} cm away"
            return _with(row, APART, f"It is an outlier: {others}.")
        if row.given is None:
            return _with(row)
        found = verify(row.given, Verdict(ACCEPTED, "", stay.camera_from_lidar, covariance=stay.covariance), DRIVE)
        if suspect and found.word == ACCEPTED:
            found = replace(found, word=CANNOT_TELL, reason="Most drives of the car have wrong input.")
        return _with(row, found.word, f"{len(stay.members)} drives of the car agree. {found.reason}", found)

    def _scatter(self, row: Row) -> float:
        """Scatter of its frames relative to the other drives', or 0 if that is not unusual."""
        others = [_agreement(other) for other in self.told if other.folder != row.folder]
        if len(others) < FEWEST:
            return 0.0
        ratio = float((_agreement(row) / np.median(others, axis=0)).max())
        return ratio if ratio > SCATTERED else 0.0

    def _moves(self) -> Iterator[Move]:
        for before, after in pairwise(self.mount.stays):
            last, first = self.told[before.members[-1]], self.told[after.members[0]]
            certain = self._is_sure(before) and self._is_sure(after)
            if certain or before.is_firm or after.is_firm:
                yield Move(last, first, *difference(before, after), len(after.members), certain)

    def _is_sure(self, stay: Stay) -> bool:
        """Whether enough drives agree on it, or one is sufficient by itself."""
        return stay.is_firm or any(believed(self.told[at]) for at in stay.members)


def histories(rows: Iterable[Row]) -> list[History]:
    """The history of every camera of every car: first those that moved, then those with the worst drives."""

    def whose(row: Row) -> tuple[str, str]:
        return row.car, row.camera

    fleet = [list(drives) for _, drives in groupby(sorted(rows, key=whose), key=whose)]
    ordered = [
        sorted(drives, key=lambda row: row.date) for drives in fleet
    ]  # stable, so drives without dates stay as listed
    told = [[row for row in drives if _tells(row)] for drives in ordered]
    excess = excess_of([[_finding(row) for row in drives] for drives in told])
    found = [
        History(*whose(drives[0]), tuple(drives), tuple(some), mount_over([_finding(row) for row in some], excess))
        for drives, some in zip(ordered, told, strict=True)
    ]
    return sorted(found, key=lambda one: (not one.moves, -sum(row.word in (REJECTED, FAILED) for row in one.rows)))


def judged_by_cars(rows: Sequence[Row]) -> list[Row]:
    """The rows in the same order, each with the verdict of all drives of its car."""
    judged = {row.folder: row for history in histories(rows) for row in history.judged}
    return [judged[row.folder] for row in rows]


def believed(row: Row) -> bool:
    """Whether a drive by itself is sufficient to say where the mount is."""
    return _tells(row) and row.verdict in (ACCEPTED, REJECTED)


def _tells(row: Row) -> bool:
    """Whether a drive's result says something about the mount, if only vaguely; with wrong input it does not."""
    return row.extrinsic is not None and row.uncertainty is not None and not row.cause


def _finding(row: Row) -> Finding:
    assert row.extrinsic is not None and row.uncertainty is not None
    return Finding(row.extrinsic, row.uncertainty)


def _with(row: Row, word: ByCar = "", reason: str = "", found: Verdict | None = None) -> Row:
    """A drive with the columns of its car's verdict, empty without one."""
    return replace(
        row,
        by_car=word,
        by_car_reason=reason,
        by_car_moved_deg=None if found is None else found.moved[0],
        by_car_moved_cm=None if found is None else found.moved[1],
        by_car_sigma_deg=None if found is None else found.sigma_rotation_deg,
        by_car_sigma_cm=None if found is None else found.sigma_translation_cm,
    )


def _agreement(row: Row) -> Floats:
    """Standard deviation ``[2]`` of a single frame, in degrees and centimetres."""
    return np.asarray([row.sigma_deg or 0.0, row.sigma_cm or 0.0], np.float64) * math.sqrt(max(row.frames, 1))


def _alone(row: Row) -> Stay:
    found = _finding(row)
    return Stay((0,), found.camera_from_lidar, found.covariance)


def _when(row: Row) -> str:
    return f"{row.drive} ({row.date[:10]})" if row.date else row.drive


def _drives(count: int) -> str:
    return "1 drive" if count == 1 else f"{count} drives"


def _named(rows: Sequence[Row]) -> str:
    names = [row.drive for row in rows[:5]]
    return ", ".join(names) + (f" and {len(rows) - 5} more" if len(rows) > 5 else "")
