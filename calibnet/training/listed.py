"""Training frames of a fleet: a table of drives, of which those with a good calibration are read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from calibnet.datasets.frame import Sequence
from calibnet.datasets.published import options_of
from calibnet.datasets.registry import open_sequence
from calibnet.datasets.selection import PickedFrames, select_frames
from calibnet.errors import DatasetError
from calibnet.runtime.reading import require_file
from calibnet.runtime.schema import validated
from calibnet.runtime.text import one_line
from calibnet.verdict import ACCEPTED, with_its_car

LIST = "list"
"""What ``--data list:FILE`` begins with."""
LARGEST = 1 << 30
COLUMNS = ("car", "drive", "dataset", "path", "sequence", "camera", "selection", "options", "verdict", "by_car")
REMEDY = "give the fleet.parquet of `calib-inspect fleet`, or rows of it"


@dataclass(frozen=True)
class ListedDrive:
    """A row of the table, as far as it says where the frames are."""

    car: str
    drive: str
    dataset: str
    path: str
    sequence: str
    camera: str
    selection: str
    options: str
    verdict: str
    by_car: str = ""

    @property
    def word(self) -> str:
        """What is known of its calibration, by itself and by the other drives of its car."""
        return with_its_car(self.verdict, self.by_car)


def open_list(file: Path, verdicts: str = "") -> Iterator[Sequence]:
    """The drives of a list whose calibration is accepted, by themselves or by their car, or what else is asked for.

    Args:
        file: a Parquet table with `COLUMNS`, more do not matter.
        verdicts: words with commas between them.

    Raises:
        DatasetError: it cannot be read, is no such table, or a drive cannot be opened.
    """
    wanted = {word.strip() for word in verdicts.split(",")} if verdicts else {ACCEPTED}
    for drive in read_list(file):
        if drive.word in wanted:
            yield _opened(drive, file)


def read_list(file: Path) -> tuple[ListedDrive, ...]:
    """The rows of a list.

    Raises:
        DatasetError: it cannot be read, or is no such table.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    require_file(file, "List", LARGEST, DatasetError, REMEDY)
    try:
        there = [name for name in COLUMNS if name in pq.read_schema(file).names]
        rows = pq.read_table(file, columns=there).to_pylist()
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{file} is not a Parquet table ({one_line(str(error), 200)}); {REMEDY}.") from None
    return validated(tuple[ListedDrive, ...], rows, f"List {file}", DatasetError, REMEDY)


def _opened(drive: ListedDrive, file: Path) -> Sequence:
    name = one_line(f"{drive.car}/{drive.drive}")
    if "--guess" in drive.options or drive.dataset == "bag" or "://" in drive.path:
        raise DatasetError(
            f"{file}: {name} is a bag, lies elsewhere or has a calibration of its own (--guess), which training does "
            "not read; leave it out of the list."
        )
    sequence = open_sequence(drive.dataset, drive.path, **options_of(drive.dataset, drive.sequence, drive.camera))
    return PickedFrames(sequence, select_frames(sequence, drive.selection)) if drive.selection else sequence
