"""Opening the file of a recording, whole or cut off, and streaming the chunks of a few entities."""

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
"""Time that the repair of a file may take."""


class RecordingFile:
    """The chunks of one recording of ours.

    Attributes:
        path: the file.
        cut: whether the file ends before its footer, because the run was killed or the copy is not complete.
    """

    def __init__(self, path: Path, applications: Sequence[str] = (entities.APPLICATION_ID,)) -> None:
        """Open the file; nothing but its footer is read yet.

        Args:
            path: the file.
            applications: of `entities`, one of which must have recorded it.

        Raises:
            RecordingError: there is no such file, it is not a recording, not ours, or too damaged.
        """
        self.path = path
        self._applications = applications
        self.cut = False
        self._copy: tempfile.TemporaryDirectory[str] | None = None  # lives as long as this object
        if not path.exists():
            raise RecordingError(f"There is no recording {path}; check the path, or make one with --save {path}.")
        require_file(path, "Recording", None, RecordingError, "give a recording that calib-inspect made")
        if kind_of_file(path) is not Kind.RECORDING:
            raise self._unreadable()
        self._named = self._name_for_rerun()
        self._reader, entries = self._open()
        self._entry = self._ours(entries)

    def chunks(self, *paths: str) -> Iterator[Chunk]:
        """Every chunk of some entities.

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
        """The file; under another name where its own is no UTF-8, which Rerun takes for no name at all."""
        try:
            str(self.path).encode()
        except UnicodeEncodeError:
            self._link = tempfile.TemporaryDirectory(prefix="calib-inspect-")
            link = Path(self._link.name) / "recording.rrd"
            link.symlink_to(self.path.resolve())
            return link
        return self.path

    def _open(self) -> tuple[RrdReader, list[StoreEntry]]:
        """The file's reader and what the file holds; of a copy where the file ends within a chunk."""
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
        """Everything that precedes the cut, in a file that the reader accepts; of a foreign file, no such file."""
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
            "give a recording that one of these made."
        )

    def _unreadable(self) -> RecordingError:
        return RecordingError(
            f"{self.path} is not a Rerun recording, or so much of it is missing that nothing can be read; "
            "copy it again or record it again."
        )


def _listed(file: Path) -> tuple[RrdReader, list[StoreEntry]]:
    reader = RrdReader(file)
    return reader, reader.recordings()
