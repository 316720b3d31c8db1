"""Training frames of a fleet: the drives of a table whose calibration is good."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Len

from calibnet.datasets.frame import Sequence
from calibnet.datasets.published import options_of
from calibnet.datasets.registry import open_sequence
from calibnet.datasets.selection import PickedFrames, select_frames
from calibnet.errors import CalibnetError, DatasetError
from calibnet.runtime.schema import validated
from calibnet.runtime.tables import read_rows
from calibnet.runtime.text import one_line
from calibnet.verdict import ACCEPTED, with_its_car

LIST = "list"
"""The dataset's name in ``--data list:FILE``."""
COLUMNS = ("car", "drive", "dataset", "path", "sequence", "camera", "selection", "options", "verdict", "by_car")
REMEDY = "give the fleet.parquet of `calib-inspect fleet`, or rows of it"


@dataclass(frozen=True)
class ListedDrive:
    """The columns of a row that say where its frames are and how good its calibration is."""

    car: str
    drive: str
    dataset: str
    path: Annotated[str, Len(1, 4000)]
    sequence: str
    camera: str
    selection: str
    options: str
    verdict: str
    by_car: str = ""

    @property
    def word(self) -> str:
        """The verdict on its calibration, from this drive and from the other drives of its car."""
        return with_its_car(self.verdict, self.by_car)


def open_list(file: Path, verdicts: str = "") -> Iterator[Sequence]:
    """The drives of a list with an accepted calibration, or with one of the given verdicts.

    Args:
        file: a Parquet table with `COLUMNS`; it may have others.
        verdicts: verdicts separated by commas; empty means accepted.

    Raises:
        DatasetError: the file cannot be read, is no such table, or a drive cannot be opened.
    """
    wanted = {word.strip() for word in verdicts.split(",")} if verdicts else {ACCEPTED}
    for drive in read_list(file):
        if drive.word in wanted:
            try:
                yield _opened(drive)
            except CalibnetError as error:
                raise DatasetError(f"{file}, {one_line(f'{drive.car}/{drive.drive}')}: {error}") from None


def read_list(file: Path) -> tuple[ListedDrive, ...]:
    """The rows of a list.

    Raises:
        DatasetError: the file cannot be read, or is no such table.
    """
    rows = read_rows(file, "List", DatasetError, REMEDY, COLUMNS)
    return validated(tuple[ListedDrive, ...], rows, f"List {file}", DatasetError, REMEDY)


def _opened(drive: ListedDrive) -> Sequence:
    if "--guess" in drive.options or drive.dataset == "bag" or "://" in drive.path:
        raise DatasetError(
            "it is a bag, is on another machine or has a separate calibration (--guess), which training does not "
            "support; remove it from the list."
        )
    sequence = open_sequence(drive.dataset, drive.path, **options_of(drive.dataset, drive.sequence, drive.camera))
    return PickedFrames(sequence, select_frames(sequence, drive.selection)) if drive.selection else sequence
