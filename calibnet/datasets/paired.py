"""The base of datasets that are folders of images and scans: pairs files by name and reads them as frames."""

from __future__ import annotations

import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.clouds.bin import KITTI
from calibnet.datasets.clouds.plausibility import of_scan
from calibnet.datasets.clouds.scans import ending, full_scale_of, read_raw, read_scan
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import read_image
from calibnet.datasets.images.lens import RectifiedImage
from calibnet.datasets.images.plausibility import bit_depth, mosaic
from calibnet.datasets.pairing import TIMES
from calibnet.datasets.plausibility import of_camera, of_extrinsic, refuse
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import DatasetError
from calibnet.geometry import PinholeCamera
from calibnet.runtime.reading import register_input
from calibnet.runtime.text import listed, number_of, one_line

SCANS_LOOKED_AT = 4
"""Number of scans of a drive from which the scale of intensity is found."""


NOTES = ".txt"
"""Suffix of files that are scans only if there are no others; beside others they are labels or notes."""


class Both(NamedTuple):
    """An image and the scan taken with it."""

    image: Path
    scan: Path


@dataclass(frozen=True)
class FrameFiles:
    """The files of one frame, its number and its time in seconds since the first; a file may be missing."""

    index: int
    timestamp: float
    image: Path | None
    scan: Path | None

    @property
    def needed(self) -> Both:
        """Image and scan.

        Raises:
            DatasetError: one is missing.
        """
        if self.image is not None and self.scan is not None:
            return Both(self.image, self.scan)
        there = self.image or self.scan
        assert there is not None, "a frame has one file at least"
        what = "image" if self.image is None else "scan"
        raise DatasetError(f"There is no {what} for {there.stem} ({there}); add it, or remove this file.")


class PairedSequence(ABC):
    """A `calibnet.datasets.frame.Sequence` of image and scan files.

    A subclass lists the files and gives the calibration of each frame.

    Attributes:
        notes: sentences for the user on how the data is read.
    """

    notes: tuple[str, ...] = ()
    cloud_columns: tuple[str, ...] | None = KITTI
    """Columns of ``.bin`` clouds; None to recognise them."""

    def __init__(self, name: str, rig: str, files: Sequence[FrameFiles]) -> None:
        self.name = one_line(name)
        self.rig = one_line(rig)
        self.files = tuple(files)
        for file in self.files:
            for path in (file.image, file.scan):
                if path is not None:
                    register_input(path)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.files)

    def index_of(self, position: int) -> int:
        """The number of a frame, as in its files."""
        return self.files[position].index

    def __iter__(self) -> Iterator[Frame]:
        """Read the frames in order."""
        return (self[position] for position in range(len(self)))

    def __getitem__(self, position: int) -> Frame:
        """Read one frame.

        Raises:
            DatasetError: one of its files is missing, damaged, empty, malformed, or has content that cannot be right.
            IndexError: there is no such position.
        """
        files = self.files[position]
        image_path, scan_path = files.needed
        calibration = self._calibration(files)
        image, original, faces = self._image(files)
        points = self._points(files)
        camera = PinholeCamera(image.shape[1], image.shape[0], calibration.matrix)
        extrinsic = calibration.camera_from_lidar
        remarks = refuse([*of_camera(camera), *of_extrinsic(extrinsic)], f"Calibration of {image_path}")
        remarks += refuse([bit_depth(image), mosaic(image)], f"Image {image_path}")
        remarks += refuse(of_scan(points), f"Scan {scan_path}")
        return Frame(
            index=files.index,
            timestamp=files.timestamp,
            image=image,
            points=points,
            camera=camera,
            camera_from_lidar=extrinsic,
            source=str(image_path),
            remarks=remarks,
            original=original,
            faces=faces,
        )

    @cached_property
    def _full_scale(self) -> float:
        """The intensity that becomes 1 in the whole drive, from some scans spread over it."""
        intensities = [np.zeros(0, np.float32)]
        for position in evenly_spaced(len(self.files), SCANS_LOOKED_AT):
            with suppress(DatasetError):
                intensities.append(read_raw(self.files[position].needed.scan, self.cloud_columns)[:, 3])
        return full_scale_of(np.concatenate(intensities))

    @abstractmethod
    def _calibration(self, files: FrameFiles) -> Calibration:
        """The calibration of one frame."""

    def _points(self, files: FrameFiles) -> NDArray[np.float32]:
        """The scan ``[N, 4]`` of one frame, in our axes."""
        return read_scan(files.needed.scan, self.cloud_columns, self._full_scale)

    def _image(self, files: FrameFiles) -> RectifiedImage:
        """The image of one frame."""
        return RectifiedImage(read_image(files.needed.image))


def require_folder(folder: Path, remedy: str) -> Path:
    """Return ``folder`` if it is a folder.

    Raises:
        DatasetError: it is not; the message ends with ``remedy``.
    """
    if not folder.is_dir():
        problem = "is not a folder" if folder.exists() else "does not exist"
        raise DatasetError(f"{folder} {problem}; {remedy}.")
    return folder


def files_by_stem(folder: Path, suffixes: Sequence[str], what: str) -> dict[str, Path]:
    """The files of ``folder`` with one of the suffixes, by their names without it, in order: ``9`` before ``10``.

    Raises:
        DatasetError: there is none, or two share a stem.
    """
    files: dict[str, Path] = {}
    found = [(path, ending(path, suffixes)) for path in sorted(folder.iterdir(), key=_in_order) if path.name != TIMES]
    found = [(path, suffix) for path, suffix in found if suffix and not path.name.startswith(".")]
    are_notes = any(suffix != NOTES for _, suffix in found)
    for path, suffix in found:
        if suffix == NOTES and are_notes:
            continue
        stem = unicodedata.normalize("NFC", path.name[: -len(suffix)])  # macOS separates letters and accents
        if stem in files:
            raise DatasetError(f"{folder} has both {files[stem].name} and {path.name}; keep one of them.")
        files[stem] = path
    if not files:
        others = sorted({path.suffix for path in folder.iterdir() if path.suffix})
        there = f", only {', '.join(others[:5])}" if others else ""
        raise DatasetError(f"{folder} has no {what} ({', '.join(suffixes)}){there}; put them there.")
    return files


def _in_order(path: Path) -> tuple[list[str | int], str]:
    """Sort key of a file: words as text, digits as numbers."""
    parts = re.split(r"([0-9]+)", path.name)
    return [int(part) if place % 2 else part for place, part in enumerate(parts)], path.name


class Partners(NamedTuple):
    """The images that have a scan of the same name, by stem, and sentences on what is left out."""

    images: dict[str, Path]
    notes: tuple[str, ...]


def with_partners(images: dict[str, Path], scans: dict[str, Path]) -> Partners:
    """Leave out what has no partner: KITTI itself lacks some scans, and a download may lack more.

    Raises:
        DatasetError: no image has a scan.
    """
    if not images.keys() & scans.keys():
        image_folder, scan_folder = (next(iter(files.values())).parent for files in (images, scans))
        raise DatasetError(
            f"No image of {image_folder} has a scan of the same name in {scan_folder} (their first are "
            f"{next(iter(images))} and {next(iter(scans))}); unpack both."
        )
    alone = {
        "image": [stem for stem in images if stem not in scans],
        "scan": [stem for stem in scans if stem not in images],
    }
    notes = [
        f"{number_of(len(stems), what)} without a partner {'is' if len(stems) == 1 else 'are'} left out "
        f"({listed(stems)})."
        for what, stems in alone.items()
        if stems
    ]
    return Partners({stem: path for stem, path in images.items() if stem in scans}, tuple(notes))
