"""``rerun-importer-calib-inspect``: makes ``rerun FOLDER`` open KITTI sequences and own sensors.

The viewer calls every ``rerun-importer-*`` on the PATH with every path it is asked to open. An importer that does not
know the path has to exit at once with a certain code and without output; the others write a recording to stdout. Ours
calibrates some frames from all over the sequence as the commands do.
"""

from __future__ import annotations

import contextlib
import itertools
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from calibnet.datasets import Sequence

INCOMPATIBLE = 66
"""Rerun's exit code for "not mine", as a number since importing Rerun takes longer than recognising a path."""
MOST_FRAMES = 24
"""Largest number of frames calibrated: the viewer waits for them, and `calib-inspect seq` records them all."""
RANGE = "5/0.5"
DEEPEST = 3
"""Largest number of folders between a file and the folder that is recognised, itself counted."""
RAW_DRIVE = re.compile(r"(\d{4}_\d{2}_\d{2})_drive_(\d{4})_(?:sync|extract)")


class Recognised(NamedTuple):
    """A folder that we can read.

    Attributes:
        dataset: its name, as `calibnet.datasets.open_sequence` takes it.
        root: the dataset's folder.
        options: keywords of `open_sequence` that select the part of it.
        as_is: whether its extrinsic is a guess to be corrected rather than a reference.
    """

    dataset: str
    root: Path
    options: dict[str, str]
    as_is: bool


def recognise(path: Path) -> Recognised | None:
    """What a path holds, judged by file names alone; None for everything else."""
    if not path.is_dir():
        return None
    path = path.resolve()
    if path.parent.name == "sequences" and _holds(path, "image_2", "velodyne", "calib.txt"):
        return Recognised("kitti-odometry", path.parent.parent, {"sequence": path.name}, False)
    drive = RAW_DRIVE.fullmatch(path.name)
    if drive and _holds(path, "image_02", "velodyne_points") and _holds(path.parent, "calib_cam_to_cam.txt"):
        return Recognised("kitti-raw", path.parent.parent, {"date": drive[1], "drive": drive[2]}, False)
    if _holds(path, "calibration.yaml", "images", "clouds"):
        return Recognised("folder", path, {}, True)
    return None


def import_folder(found: Recognised, joins: tuple[str, str] | None) -> None:
    """Calibrate and write the recording to stdout.

    Args:
        found: the folder.
        joins: ids of the viewer's own recording of it, see `ids`.

    Raises:
        CalibnetError: the folder cannot be read, or no frame can be calibrated.
    """
    from rich.console import Console

    from calibnet.cascade.cascade import Cascade
    from calibnet.datasets import open_sequence
    from calibnet.datasets.selection import evenly_spaced
    from calibnet.geometry import MiscalibrationRange
    from inspector.record.contents import Contents, Detail
    from inspector.record.outputs import Outputs
    from inspector.record.recording import RunDescription
    from inspector.run.session import Session
    from inspector.run.start import Start

    sequence: Sequence = open_sequence(found.dataset, found.root, **found.options)
    positions = evenly_spaced(len(sequence), MOST_FRAMES)
    start = Start(MiscalibrationRange.parse(RANGE), as_is=found.as_is)
    cascade = Cascade.load(stages=start.stages, wider=True)
    title = f"{sequence.name}, {len(positions)} of {len(sequence)} frames"
    identity = {"sequence": sequence.name, "rig": sequence.rig, "detail": str(Detail.OVERVIEW)}
    Session(
        sequence=sequence,
        positions=positions,
        cascade=cascade,
        skipped=cascade.skipped,
        start=start,
        outputs=Outputs(),
        description=RunDescription(title, identity, joins=joins),
        contents=Contents.of(Detail.OVERVIEW),
        drive=len(positions) > 1,
        console=Console(quiet=True),
    ).run()


def ids(options: list[str]) -> tuple[str, str] | None:
    """The application and the recording id that the viewer gives its own recording of the path, if it says so.

    What is written under these joins that recording. Under an id of its own it would be a second one, behind images
    without a layout.
    """
    given = dict(itertools.pairwise(options))
    application, recording = given.get("--application-id"), given.get("--recording-id")
    return (application, recording) if application and recording else None


def is_read_already(path: Path, application: str) -> bool:
    """Whether a file belongs to a folder of ours that the viewer opens, which names its application after the folder.

    The viewer asks for each of its files as well, and reports those that nobody takes as errors.
    """
    above = path.resolve().parents[:DEEPEST]
    return any(folder.name == application and recognise(folder) is not None for folder in above)


def main() -> None:
    """Entry point of the console script."""
    found, joins = None, ids(sys.argv[2:])
    with contextlib.suppress(OSError, IndexError):
        path = Path(sys.argv[1])
        found = recognise(path)
        if found is None and joins and is_read_already(path, joins[0]):
            sys.exit(0)
    if found is None:
        sys.exit(INCOMPATIBLE)
    from calibnet.errors import CalibnetError

    try:
        import_folder(found, joins)
    except (CalibnetError, OSError):
        sys.exit(INCOMPATIBLE)


def _holds(folder: Path, *names: str) -> bool:
    return all((folder / name).exists() for name in names)
