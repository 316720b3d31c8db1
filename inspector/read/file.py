"""Opens the file of a recording, complete or cut off, and streams the chunks of a few entities."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rerun.chunk import RrdReader

from calibnet.runtime.reading import require_file
from calibnet.runtime.writing import Kind, kind_of_file
from inspector import entities
from inspector.programs import rerun_binary
from inspector.read.understood import RecordingError, understood

if TYPE_CHECKING:
    from rerun.chunk import Chunk, StoreEntry


REPAIR_S = 300.0
"""Largest time for the repair of a file, in seconds."""


class RecordingFile:
    """The chunks of one recording of ours.

    Attributes:
        path: the file.
        cut: whether the file ends before its footer, because the run was killed or the copy is not complete.
    """

    def __init__(self, path: Path, applications: Sequence[str] = (entities.APPLICATION_ID,)) -> None:
        """Open the file and read only its footer.

        Args:
            path: the file.
            applications: ids from `entities`, one of which must have recorded the file.

        Raises:
            RecordingError: there is no such file, it is not a recording, not ours, or too damaged.
        """
        self.path = path
        self._applications = applications
        self.cut = False
        self._copy: tempfile.TemporaryDirectory[str] | None = None  # kept as long as this object
        if not path.exists():
            raise RecordingError(f"{path} does not exist; check the path, or make a recording with --save {path}.")
        require_file(path, "Recording", None, RecordingError, "give a recording made by calib-inspect")
        if kind_of_file(path) is not Kind.RECORDING:
            raise self._unreadable()
        self._named = self._name_for_rerun()
        self._reader, entries = self._open()
        self._entry = self._ours(entries)

    def chunks(self, *paths: str) -> Iterator[Chunk]:
        """All chunks of some entities.

        Args:
            paths: entity paths or patterns such as ``extrinsic/**``; chunks of others are not read.

        Raises:
            RecordingError: a chunk is damaged.
        """
        source = self._reader.stream(store=self._entry) if self.cut else self._reader.store(store=self._entry).stream()
        with understood(self.path):
            try:
                yield from source.filter(content=[f"/{path}" for path in paths])
            except RuntimeError:
                raise RecordingError(
                    f"{self.path} is damaged in the middle; copy it again or record it again."
                ) from None

    def _name_for_rerun(self) -> Path:
        """The file, under another name if its own is not UTF-8, which Rerun does not accept."""
        try:
            str(self.path).encode()
        except UnicodeEncodeError:
            self._link = tempfile.TemporaryDirectory(prefix="calib-inspect-")
            link = Path(self._link.name) / "recording.rrd"
            link.symlink_to(self.path.resolve())
            return link
        return self.path

    def _open(self) -> tuple[RrdReader, list[StoreEntry]]:
        """The file's reader and entries; those of a repaired copy if the file ends within a chunk."""
        with understood(self.path), warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            with contextlib.suppress(RuntimeError, ValueError):
                opened = _listed(self._named)
                self.cut = any("no footer" in str(warning.message) for warning in caught)
                return opened
            with contextlib.suppress(RuntimeError, ValueError):
                opened = _listed(self._repaired_copy())
                self.cut = True
                return opened
        raise self._unreadable()

    def _repaired_copy(self) -> Path:
        """A copy of everything before the cut, which the reader accepts; for a foreign file, it does not exist."""
        self._copy = tempfile.TemporaryDirectory(prefix="calib-inspect-")
        copy = Path(self._copy.name) / "repaired.rrd"
        command = [rerun_binary(), "rrd", "filter", "--drop-entity", "/none", str(self._named), "-o", str(copy)]
        with contextlib.suppress(subprocess.TimeoutExpired):
            subprocess.run(command, capture_output=True, check=False, timeout=REPAIR_S)
        return copy

    def _ours(self, entries: list[StoreEntry]) -> StoreEntry:
        for entry in entries:
            if entry.application_id in self._applications:
                return entry
        if not entries:
            raise self._unreadable()
        others = ", ".join(sorted({repr(entry.application_id) for entry in entries}))
        raise RecordingError(
            f"{self.path} was recorded by {others}, not by calib-inspect seq, raw, object, folder or demo; "
            "give a recording made by one of these."
        )

    def _unreadable(self) -> RecordingError:
        return RecordingError(
            f"{self.path} is not a Rerun recording, or too much of it is missing; copy it again or record it again."
        )


def _listed(file: Path) -> tuple[RrdReader, list[StoreEntry]]:
    reader = RrdReader(file)
    return reader, reader.recordings()
