"""What the drives of a car say together: where its mount was, when it moved, and how good each calibration was.

A drive alone often cannot tell; all drives of a car between two moves of its mount can (`calibnet.judging.mount`). What
they agree on is held against the calibration that each of them had, as `verify` does it for one.
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
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED, Verdict
from inspector.fleet.table import APART, FAILED, ByCar, Row

SCATTERED = 3.0
"""Times that a drive's frames may agree less than those of its car's other drives."""
WHY = "the mount may have moved during the drive, or scans and pictures not belong together."


@dataclass(frozen=True)
class Move:
    """A mount that is elsewhere than before.

    Attributes:
        before, after: the last drive on which it was where it had been, and the first one of those after.
        rotation_deg, translation_cm: how far it moved.
        drives: after it, until the next.
        certain: whether on either side enough drives agree, or one says by itself where the mount is.
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
        return f"The mount seems to have moved {between}, {far}; there are too few drives yet to be sure."


@dataclass(frozen=True)
class History:
    """The drives of one camera of a car, and where its mount was.

    Attributes:
        car, camera: whose.
        rows: all drives, in order.
        told: those that say where the mount was.
        mount: where it was; positions are among ``told``.
    """

    car: str
    camera: str
    rows: tuple[Row, ...]
    told: tuple[Row, ...] = ()
    mount: Mount = field(default_factory=Mount)

    @property
    def name(self) -> str:
        """For pages."""
        return f"{self.car}, camera {self.camera}" if self.camera else self.car

    @property
    def moves(self) -> tuple[Move, ...]:
        """Moves of the mount, in their order."""
        return tuple(self._moves())

    @property
    def sentence(self) -> str:
        """What has to be known of it."""
        moves = self.moves
        parts = [str(move) for move in moves]
        wrong = [row for row in self.rows if row.verdict == REJECTED and row.cause]
        off = [row for row in self.rows if row.word == REJECTED and not row.cause]
        failed = [row for row in self.rows if row.verdict == FAILED]
        apart = [row for row in self.judged if row.by_car == APART]
        if wrong:
            causes = ", ".join(dict.fromkeys(row.cause for row in wrong))
            parts.append(f"{_drives(len(wrong))} with wrong input ({causes}).")
        if off:
            same = ", by the same on all" if len(off) > 1 and not moves else ""
            parts.append(f"The calibration is off on {_drives(len(off))}{same}.")
        if apart:
            parts.append(f"{_named(apart)} {'stands' if len(apart) == 1 else 'stand'} apart from the others.")
        if failed:
            parts.append(f"{_drives(len(failed))} failed.")
        if not parts and not any(row.word in (ACCEPTED, REJECTED) for row in self.rows):
            parts.append("No drive tells.")
        return " ".join(parts) or "Nothing moved."

    @cached_property
    def judged(self) -> tuple[Row, ...]:
        """Its drives, each with what all of them say of the calibration that it had."""
        suspect = 2 * sum(bool(row.cause) for row in self.rows) > len(self.rows)
        places = {row.folder: at for at, row in enumerate(self.told)}
        return tuple(
            self._judged(row, places[row.folder], suspect) if row.folder in places else _with(row) for row in self.rows
        )

    def _judged(self, row: Row, at: int, suspect: bool) -> Row:
        """A drive at a position of `told`; ``suspect`` where most drives of the car have wrong input."""
        if ratio := self._scatter(row):
            return _with(row, APART, f"Its frames agree {ratio:.0f} times less than those of the other drives: {WHY}")
        firm = [stay for stay in self.mount.stays if stay.is_firm]
        stay = self.mount.stay_of(at)
        if not firm:
            return _with(row)
        if stay is None or not stay.is_firm:
            near = min(firm, key=lambda one: min(abs(member - at) for member in one.members))
            turn, shift = difference(near, _alone(row))
            others = f"{len(near.members)} other drives find the mount {turn:.2f}° / {shift:.0f} cm elsewhere"
            return _with(row, APART, f"It stands apart: {others}.")
        if row.given is None:
            return _with(row)
        found = verify(row.given, Verdict(ACCEPTED, "", stay.camera_from_lidar, covariance=stay.covariance), DRIVE)
        if suspect and found.word == ACCEPTED:
            found = replace(found, word=CANNOT_TELL, reason="Most drives of the car have wrong input.")
        return _with(row, found.word, f"{len(stay.members)} drives of the car agree. {found.reason}", found)

    def _scatter(self, row: Row) -> float:
        """How many times less its frames agree than those of the other drives do, 0 where that is nothing unusual."""
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
        """Whether it is more than a few drives that nobody can tell about."""
        return stay.is_firm or any(believed(self.told[at]) for at in stay.members)


def histories(rows: Iterable[Row]) -> list[History]:
    """The history of every camera of every car: those that moved first, then those with the worst drives."""

    def whose(row: Row) -> tuple[str, str]:
        return row.car, row.camera

    fleet = [list(drives) for _, drives in groupby(sorted(rows, key=whose), key=whose)]
    ordered = [sorted(drives, key=lambda row: row.date) for drives in fleet]  # stable: without dates as listed
    told = [[row for row in drives if _tells(row)] for drives in ordered]
    excess = excess_of([[_finding(row) for row in drives] for drives in told])
    found = [
        History(*whose(drives[0]), tuple(drives), tuple(some), mount_over([_finding(row) for row in some], excess))
        for drives, some in zip(ordered, told, strict=True)
    ]
    return sorted(found, key=lambda one: (not one.moves, -sum(row.word in (REJECTED, FAILED) for row in one.rows)))


def judged_by_cars(rows: Sequence[Row]) -> list[Row]:
    """The rows as they stand, each with what the drives of its car say together of the calibration that it had."""
    judged = {row.folder: row for history in histories(rows) for row in history.judged}
    return [judged[row.folder] for row in rows]


def believed(row: Row) -> bool:
    """Whether a drive says by itself where the mount is."""
    return _tells(row) and row.verdict in (ACCEPTED, REJECTED)


def _tells(row: Row) -> bool:
    """Whether what was found on a drive is something of the mount, be it unsure; with wrong input it is not."""
    return row.extrinsic is not None and row.uncertainty is not None and not row.cause


def _finding(row: Row) -> Finding:
    assert row.extrinsic is not None and row.uncertainty is not None
    return Finding(row.extrinsic, row.uncertainty)


def _with(row: Row, word: ByCar = "", reason: str = "", found: Verdict | None = None) -> Row:
    """A drive with the columns that its car fills; empty where that says nothing."""
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
    """Deviation ``[2]`` that a single one of its frames would have: degrees and centimetres."""
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
