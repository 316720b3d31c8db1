"""The drives of a fleet, from rows of DRIVES.csv or from folders, and the command line that verifies each."""

from __future__ import annotations

import csv
import io
import os
import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Annotated, ClassVar

from annotated_types import Len

from calibnet.datasets import dataset_names
from calibnet.datasets.published import PUBLISHED, Published
from calibnet.errors import ConfigError
from calibnet.runtime.reading import TEXT_BYTES, read_text
from calibnet.runtime.schema import validated
from calibnet.runtime.text import file_name, one_line

BAG, FOLDER = "bag", "folder"
PATH_OPTIONS = ("--guess", "--weights")
"""Options of a drive that name files, which like its path are relative to the list."""
MOST_DRIVES = 1_000_000
REMEDY = "docs/fleet.md says what a list of drives holds"

Name = Annotated[str, Len(1, 200)]
Text = Annotated[str, Len(0, 4000)]


@dataclass(frozen=True)
class _Columns:
    """A row of the list as in the file; everything but the path has a default."""

    __pydantic_config__: ClassVar = {"extra": "forbid"}

    path: Annotated[str, Len(1, 4000)]
    car: Text = ""
    drive: Text = ""
    date: Text = ""
    dataset: Text = ""
    sequence: Text = ""
    camera: Text = ""
    frames: Text = ""
    options: Text = ""


@dataclass(frozen=True)
class Drive:
    """One drive of one camera, which is calibrated as a whole.

    Attributes:
        car: car or robot that carries the sensors.
        drive: name of the drive, unique in a fleet together with car and camera.
        date: date of the drive in ISO 8601, by which drives of a car are ordered, or empty.
        dataset: a name from `calibnet.datasets.dataset_names`, or ``"bag"``.
        path: absolute path of a folder or file, or a URL that fsspec supports.
        sequence: sequence of a dataset that has several, for instance ``"04"`` or ``"2011_09_26/0005"``.
        camera: name of the camera, where there are several; empty for the default.
        frames: selection of frames, as for ``--frames``; empty for the default.
        common: options of ``calib-inspect verify`` for every drive, as words, which everything else here overrides.
        options: options of this drive, which override all others.
        origin: where it is listed, for messages.
    """

    car: str
    drive: str
    dataset: str
    path: str
    date: str = ""
    sequence: str = ""
    camera: str = ""
    frames: str = ""
    common: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    origin: str = ""

    @property
    def name(self) -> str:
        """Name for messages and titles."""
        return f"{self.car}/{self.drive}" + (f", camera {self.camera}" if self.camera else "")

    @property
    def folder(self) -> str:
        """Folder of its results, relative to the fleet's, with special characters quoted."""
        last = f"{self.drive}@{self.camera}" if self.camera else self.drive
        return f"drives/{file_name(self.car)}/{file_name(last)}"

    @property
    def labels(self) -> dict[str, str]:
        """Properties that tell its recording from others."""
        return {"car": self.car, "drive": self.drive, **({"date": self.date} if self.date else {})}

    def arguments(self, path: str | None = None) -> list[str]:
        """Arguments of ``calib-inspect verify`` that do by hand what the fleet does with the drive.

        Args:
            path: path of its data, if not its own.
        """
        path, camera = self.path if path is None else path, self.camera
        if self.dataset in PUBLISHED:
            published = PUBLISHED[self.dataset]
            named = published.named(self.sequence)
            camera = camera or named.pop("camera", "")
            arguments = [published.command, *named.values(), "--root", path]
        elif self.dataset in (BAG, FOLDER):
            arguments = [self.dataset, path]
        else:
            arguments = [FOLDER, path, "--dataset", self.dataset]
        arguments += self.common  # the last one of a repeated option counts
        arguments += ["--camera", camera] if camera else []
        arguments += ["--frames", self.frames] if self.frames else []
        return [*arguments, *self.options]

    @property
    def files(self) -> tuple[str, ...]:
        """Patterns, relative to its path, of the files that belong to it; an empty pattern for all."""
        of_it = PUBLISHED.get(self.dataset)
        return ("",) if of_it is None else of_it.files_of(self.sequence, self.camera)


def find_drives(sources: Sequence[str], options: str = "") -> list[Drive]:
    """The drives that are named by a command's arguments.

    Args:
        sources: one ``.csv`` file, or folders of the plain layout.
        options: options of every drive, which those of a row override.

    Raises:
        ConfigError: a row is not valid, or two drives have the same name.
    """
    common = _words(options, "--options", Path.cwd())
    if len(sources) == 1 and sources[0].lower().endswith(".csv"):
        drives = list(read_drives(Path(sources[0]), common))
    else:
        drives = [_of_folder(Path(source), common) for source in sources]
    _check_distinct(drives)
    return drives


def read_drives(file: Path, common: Sequence[str] = ()) -> Iterator[Drive]:
    """The rows of a list of drives.

    Raises:
        ConfigError: the file cannot be read, or a row is not valid; the sentence names the row.
    """
    text = read_text(file, "List of drives", TEXT_BYTES, ConfigError, REMEDY)
    reader = csv.DictReader(io.StringIO(text, newline=""), restkey="", strict=True)
    count = 0
    try:
        for count, values in enumerate(reader, start=1):
            yield _of_row(values, f"{file}, row {count} (line {reader.line_num})", file.parent, common)
            if count > MOST_DRIVES:
                raise ConfigError(f"{file} has more than {MOST_DRIVES:,} rows; split it into several lists.")
    except csv.Error as error:
        raise ConfigError(f"{file}, row {count + 1}: {error}; {REMEDY}.") from None
    if not count:
        raise ConfigError(f"{file} lists no drives; {REMEDY}.")


def _of_row(values: dict[str, str | list[str] | None], origin: str, base: Path, common: Sequence[str]) -> Drive:
    if "" in values:
        raise ConfigError(f"{origin}: the row has more fields than the first line; {REMEDY}.")
    given = {str(name).strip(): str(value or "").strip() for name, value in values.items()}
    row = validated(_Columns, given, origin, ConfigError, REMEDY)
    dataset = row.dataset or FOLDER
    known = (*dataset_names(), BAG)
    if dataset not in known:
        raise ConfigError(f"{origin}: dataset {dataset!r} is not known; choose from {', '.join(known)}.")
    if dataset in PUBLISHED:
        _check_sequence(PUBLISHED[dataset], dataset, row.sequence, origin)
    path = row.path if "://" in row.path else _absolute(base, row.path)
    place = PurePosixPath(path.replace(os.sep, "/").rstrip("/"))
    return Drive(
        car=one_line(row.car or place.parent.name or "car"),
        drive=one_line(row.drive or " ".join(part for part in (place.name, row.sequence) if part)),
        date=_date(row.date, origin),
        dataset=dataset,
        path=path,
        sequence=row.sequence,
        camera=one_line(row.camera),
        frames=row.frames,
        common=tuple(common),
        options=_words(row.options, f"{origin}: options", base),
        origin=origin,
    )


def _check_sequence(published: Published, dataset: str, sequence: str, origin: str) -> None:
    """Check that a row names a sequence of its dataset that is one drive.

    Raises:
        ConfigError: it does not.
    """
    if not published.one_mount:
        raise ConfigError(
            f"{origin}: the frames of {dataset} come from several mounts and do not form a drive; leave the row out."
        )
    if not sequence and published.whole is None:
        raise ConfigError(f"{origin}: sequence is missing, for instance {published.example}; {REMEDY}.")
    try:
        named = published.named(sequence)
    except ConfigError as error:
        raise ConfigError(f"{origin}: {error}") from None
    if any(word.startswith("-") for word in named.values()):
        raise ConfigError(f"{origin}: sequence {sequence!r} must not begin with a dash; {REMEDY}.")


def _of_folder(folder: Path, common: Sequence[str]) -> Drive:
    absolute = Path(_absolute(Path(), str(folder)))
    if not absolute.is_dir():
        raise ConfigError(f"{folder} is neither a folder nor a .csv file; give a list of drives, or folders of drives.")
    car, drive = one_line(absolute.parent.name or "car"), one_line(absolute.name)
    return Drive(car, drive, FOLDER, str(absolute), common=tuple(common), origin=str(folder))


def _date(text: str, origin: str) -> str:
    try:
        return datetime.fromisoformat(text).isoformat() if text else ""
    except ValueError:
        raise ConfigError(f"{origin}: date {text!r} is not a date, for instance 2026-03-01T14:05.") from None


def _words(text: str, origin: str, base: Path) -> tuple[str, ...]:
    """Options as words, with the files that they name made absolute."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise ConfigError(f"{origin} cannot be split into words ({error}); check the quotes.") from None
    made: list[str] = []
    for word in words:
        option, equals, value = word.partition("=")
        if made and made[-1] in PATH_OPTIONS:
            word = _absolute(base, word)
        elif equals and option in PATH_OPTIONS:
            word = f"{option}={_absolute(base, value)}"
        made.append(word)
    return tuple(made)


def _check_distinct(drives: Iterable[Drive]) -> None:
    seen: dict[str, Drive] = {}
    for drive in drives:
        first = seen.setdefault(drive.folder, drive)
        if first is not drive:
            raise ConfigError(
                f"{drive.origin} and {first.origin} are both called {drive.name}; give them different names."
            )


def _absolute(base: Path, path: str) -> str:
    """The absolute form of a path relative to ``base``, with links kept."""
    return os.path.normpath(base.absolute() / path)
