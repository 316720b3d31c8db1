"""What the drives of a car say over time: when its mount moved.

A drive's finding counts where it can be believed: the calibration that it had was accepted, or rejected for being off
and for nothing else. Two findings are held against each other as `verify` holds a calibration against one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from calibnet.geometry import pose_error
from calibnet.judging.verify import DRIVE, verify
from calibnet.verdict import ACCEPTED, REJECTED, Verdict
from inspector.fleet.table import FAILED, Row


@dataclass(frozen=True)
class Move:
    """A mount that is elsewhere than before.

    Attributes:
        before, after: the last drive on which it was where it had been, and the first one of those after.
        rotation_deg, translation_cm: how far it moved.
    """

    before: Row
    after: Row
    rotation_deg: float
    translation_cm: float

    def __str__(self) -> str:
        between = f"between {_when(self.before)} and {_when(self.after)}"
        return f"The mount moved {between}, by {self.rotation_deg:.2f}° / {self.translation_cm:.0f} cm."


@dataclass(frozen=True)
class History:
    """The drives of one camera of a car, in order, and the moves of its mount."""

    car: str
    camera: str
    rows: tuple[Row, ...]
    moves: tuple[Move, ...]

    @property
    def name(self) -> str:
        """For pages."""
        return f"{self.car}, camera {self.camera}" if self.camera else self.car

    @property
    def sentence(self) -> str:
        """What has to be known of it."""
        if self.moves:
            return " ".join(map(str, self.moves))
        wrong = [row for row in self.rows if row.verdict == REJECTED and row.cause]
        off = [row for row in self.rows if row.verdict == REJECTED and not row.cause]
        failed = [row for row in self.rows if row.verdict == FAILED]
        parts = []
        if wrong:
            causes = ", ".join(dict.fromkeys(row.cause for row in wrong))
            parts.append(f"{_drives(len(wrong))} with wrong input ({causes}).")
        if off:
            same = ", by the same on all" if len(off) > 1 else ""
            parts.append(f"The calibration is off on {_drives(len(off))}{same}.")
        if failed:
            parts.append(f"{_drives(len(failed))} failed.")
        if not parts and not any(believed(row) for row in self.rows):
            parts.append("No drive tells.")
        return " ".join(parts) or "Nothing moved."


def histories(rows: Iterable[Row]) -> list[History]:
    """The history of every camera of every car: those that moved first, then those with the worst drives."""

    def whose(row: Row) -> tuple[str, str]:
        return row.car, row.camera

    found = [_history(*name, list(drives)) for name, drives in groupby(sorted(rows, key=whose), key=whose)]
    return sorted(found, key=lambda one: (not one.moves, -sum(row.verdict in (REJECTED, FAILED) for row in one.rows)))


def believed(row: Row) -> bool:
    """Whether what was found on a drive says where the mount is."""
    known = row.extrinsic is not None and row.uncertainty is not None
    return known and (row.verdict == ACCEPTED or (row.verdict == REJECTED and not row.cause))


def _history(car: str, camera: str, rows: Sequence[Row]) -> History:
    in_order = sorted(rows, key=lambda row: row.date)  # stable: without dates as they are listed
    return History(car, camera, tuple(in_order), tuple(_moves([row for row in in_order if believed(row)])))


def _moves(rows: Sequence[Row]) -> Iterator[Move]:
    """Where a finding differs, significantly and by more than is tolerated, from the surest one since the last move."""
    if not rows:
        return
    surest, last = rows[0], rows[0]
    for row in rows[1:]:
        if _differ(surest, row):
            assert row.extrinsic is not None and surest.extrinsic is not None
            error = pose_error(row.extrinsic, surest.extrinsic)
            yield Move(last, row, error.rotation_deg, error.translation_cm)
            surest = row
        elif (row.sigma_deg or 0.0) < (surest.sigma_deg or 0.0):
            surest = row
        last = row


def _differ(one: Row, other: Row) -> bool:
    first, second = one.extrinsic, other.extrinsic
    assert first is not None and second is not None and one.uncertainty is not None and other.uncertainty is not None
    found = Verdict(ACCEPTED, "", second, covariance=one.uncertainty + other.uncertainty)
    return verify(first, found, DRIVE[-1:]).word == REJECTED


def _when(row: Row) -> str:
    return f"{row.drive} ({row.date[:10]})" if row.date else row.drive


def _drives(count: int) -> str:
    return "1 drive" if count == 1 else f"{count} drives"
