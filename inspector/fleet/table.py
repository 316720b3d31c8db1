"""The fleet's table: a Parquet file with one row per drive."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Len

from calibnet.errors import DatasetError
from calibnet.geometry.types import Extrinsic, Matrix6
from calibnet.judging.verify import DRIVE
from calibnet.runtime.schema import validated
from calibnet.runtime.tables import read_rows
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import Kind, write_whole
from calibnet.verdict import APART, CAUSES, Verdict, with_its_car
from inspector.fleet.drives import Drive

TABLE = "fleet.parquet"
FAILED = "failed"
"""Word for a drive that could not be read or calibrated."""
ByCar = Literal["accepted", "rejected", "cannot tell", "apart", ""]
ORDER = (FAILED, "rejected", APART, "cannot tell", "accepted")
"""All words for a drive, worst first."""
REMEDY = "make it with `calib-inspect fleet`"

Sixteen = Annotated[tuple[float, ...], Len(16, 16)]
ThirtySix = Annotated[tuple[float, ...], Len(36, 36)]


@dataclass(frozen=True, kw_only=True)
class Row:
    """The result of one drive.

    Attributes:
        car, drive, date, dataset, path, sequence, camera: as of `Drive`.
        selection: selection of its frames, as for ``--frames``; empty for the default.
        options: further options, as one text.
        verdict: verdict on the calibration that it came with: accepted, rejected, cannot tell; or failed.
        cause: names of the faults in the input, comma-separated; empty where the mount moved or nothing is wrong.
        reason: the reason of the verdict, in a sentence.
        by_car: verdict of all drives of the car together on the same calibration, see ``inspector.fleet.history``;
            apart where this drive differs from the others; empty where they are not conclusive.
        by_car_reason: the reason of ``by_car``, in a sentence.
        by_car_moved_deg, by_car_moved_cm: distance from the calibration that it came with to the result of all drives.
        by_car_sigma_deg, by_car_sigma_cm: standard deviation of that result.
        moved_deg, moved_cm: distance from the calibration that it came with to the drive's own result.
        sigma_deg, sigma_cm: standard deviation of that result, over all axes.
        frames, skipped: numbers of frames that were used and left out.
        seconds: computing time.
        given_camera_from_lidar: the calibration that it came with, 16 numbers row by row.
        camera_from_lidar: the drive's own result, likewise.
        covariance: covariance of that result, 36 numbers row by row, ``(translation m, rotation rad)``.
        folder: folder of its results, relative to the fleet's.
        recording, report, json: files, relative to the fleet's folder; empty if missing.
    """

    car: str
    drive: str
    date: str
    dataset: str
    path: str
    sequence: str
    camera: str
    selection: str
    options: str
    verdict: Literal["accepted", "rejected", "cannot tell", "failed"]
    cause: str = ""
    reason: str = ""
    by_car: ByCar = ""
    by_car_reason: str = ""
    by_car_moved_deg: float | None = None
    by_car_moved_cm: float | None = None
    by_car_sigma_deg: float | None = None
    by_car_sigma_cm: float | None = None
    moved_deg: float | None = None
    moved_cm: float | None = None
    sigma_deg: float | None = None
    sigma_cm: float | None = None
    frames: int = 0
    skipped: int = 0
    seconds: float = 0.0
    given_camera_from_lidar: Sixteen | None = None
    camera_from_lidar: Sixteen | None = None
    covariance: ThirtySix | None = None
    folder: str = ""
    recording: str = ""
    report: str = ""
    json: str = ""

    @property
    def word(self) -> str:
        """The drive's final word: its own verdict, or that of its car's drives where that is more certain or worse."""
        return with_its_car(self.verdict, self.by_car)

    @property
    def given(self) -> Extrinsic | None:
        """The calibration that it came with, 4x4."""
        return None if self.given_camera_from_lidar is None else np.reshape(self.given_camera_from_lidar, (4, 4))

    @property
    def extrinsic(self) -> Extrinsic | None:
        """The drive's own result, 4x4."""
        return None if self.camera_from_lidar is None else np.reshape(self.camera_from_lidar, (4, 4))

    @property
    def uncertainty(self) -> Matrix6 | None:
        """Covariance of the result, 6x6."""
        return None if self.covariance is None else np.reshape(self.covariance, (6, 6))

    @property
    def name(self) -> str:
        """Name for pages and messages."""
        return f"{self.car}/{self.drive}" + (f", camera {self.camera}" if self.camera else "")


def row_of(drive: Drive, **what_came: Any) -> Row:
    """The row of a drive."""
    return Row(
        car=drive.car,
        drive=drive.drive,
        date=drive.date,
        dataset=drive.dataset,
        path=one_line(drive.path, 4000),
        sequence=one_line(drive.sequence),
        camera=drive.camera,
        selection=one_line(drive.frames),
        options=one_line(" ".join((*drive.common, *drive.options))),
        folder=drive.folder,
        **what_came,
    )


def of_verdict(verdict: Verdict) -> dict[str, Any]:
    """The columns of a verdict."""
    return {
        "verdict": verdict.word,
        "cause": ", ".join(cause.name for cause in verdict.causes if cause.name in CAUSES),
        "reason": one_line(verdict.reason),
        "moved_deg": verdict.moved[0],
        "moved_cm": verdict.moved[1],
        "sigma_deg": verdict.sigma_rotation_deg,
        "sigma_cm": verdict.sigma_translation_cm,
        "camera_from_lidar": row_major(verdict.camera_from_lidar),
        "covariance": None if verdict.covariance is None else row_major(verdict.covariance),
        "frames": verdict.used,
        "skipped": len(verdict.skipped),
    }


def worst_first(rows: Iterable[Row]) -> list[Row]:
    """The rows in the order of `ORDER`; among equals, those farthest off come first."""
    return sorted(rows, key=lambda row: (ORDER.index(row.word), -severity(row), row.car, row.date, row.drive))


def severity(row: Row) -> float:
    """How far off a drive's calibration is, in tolerances of `calibnet.judging.verify.DRIVE` or in units of 2σ.

    The larger unit counts, so that a large but uncertain movement does not come before a certain one.
    """
    turn = (row.moved_deg or 0.0) / math.hypot(DRIVE.tolerances[-1].rotation_deg, 2 * (row.sigma_deg or 0.0))
    shift = (row.moved_cm or 0.0) / math.hypot(DRIVE.tolerances[-1].translation_cm, 2 * (row.sigma_cm or 0.0))
    return max(turn, shift)


def table_bytes(rows: Sequence[Row]) -> bytes:
    """The rows as a Parquet file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    number, count, numbers = pa.float64(), pa.int64(), pa.list_(pa.float64())
    types = {"float": number, "float | None": number, "int": count}
    types |= {"Sixteen | None": numbers, "ThirtySix | None": numbers}
    schema = pa.schema([(one.name, types.get(str(one.type), pa.string())) for one in fields(Row)])
    table = pa.Table.from_pylist([vars(row) for row in rows], schema)
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return bytes(sink.getvalue().to_pybytes())


def write_table(rows: Sequence[Row], file: Path) -> None:
    """Write the table, whole or not at all."""
    write_whole(file, table_bytes(rows), Kind.PARQUET)


def read_table(file: Path) -> list[Row]:
    """The rows of a table.

    Raises:
        DatasetError: it cannot be read, or is not the table of a fleet.
    """
    rows = read_rows(file, "Table", DatasetError, REMEDY)
    return list(validated(tuple[Row, ...], rows, str(file), DatasetError, REMEDY))


def row_major(matrix: Extrinsic | Matrix6) -> tuple[float, ...] | None:
    """A matrix row by row, as in the table; None for an unknown one."""
    return tuple(matrix.ravel().tolist()) if np.isfinite(matrix).all() else None
