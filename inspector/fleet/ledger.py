"""The ledger of finished drives: an entry in each drive's folder, written last, with its input, weights and options."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated

from annotated_types import Len

from calibnet.errors import CalibnetError, DatasetError
from calibnet.runtime.reading import parse_json
from calibnet.runtime.schema import validated
from inspector.fleet.drives import Drive
from inspector.fleet.places import Store
from inspector.fleet.table import FAILED, ORDER, Row, row_of

ENTRY = "drive.json"
LARGEST = 1 << 20


@dataclass(frozen=True)
class Key:
    """Everything that a result depends on.

    Attributes:
        arguments: arguments of the command that does the same by hand, without its outputs.
        weights: digest of the weights and the version that uses them.
        seen: digest of the names, sizes and times of the input files, `inspector.fleet.places.seen`.
        content: digest of their content; empty if it was not computed.
    """

    arguments: tuple[str, ...]
    weights: Annotated[str, Len(1, 64)]
    seen: Annotated[str, Len(0, 64)] = ""
    content: Annotated[str, Len(0, 64)] = ""

    def is_same(self, other: Key) -> bool:
        """Whether both give the same result: the input looks the same or has the same content."""
        if (self.arguments, self.weights) != (other.arguments, other.weights):
            return False
        return bool(self.seen and self.seen == other.seen) or bool(self.content and self.content == other.content)


@dataclass(frozen=True)
class Entry:
    """A finished drive, and the command that verified it."""

    key: Key
    row: Row
    run: Annotated[str, Len(0, 64)] = ""


def read_entry(store: Store, drive: Drive) -> Entry | None:
    """The entry of a drive; None if it is not done, or its results are missing."""
    data = store.read(f"{drive.folder}/{ENTRY}", LARGEST)
    if data is None:
        return None
    try:
        entry = validated(Entry, parse_json(data), ENTRY, DatasetError, "do it again")
    except (CalibnetError, ValueError):
        return None
    files = (entry.row.recording, entry.row.report, entry.row.json)
    if not all(store.has(file) for file in files if file):
        return None
    return replace(entry, row=replace(entry.row, date=drive.date))  # the list may have changed since


def write_entry(store: Store, drive: Drive, entry: Entry) -> None:
    """Note that a drive is done."""
    store.write(f"{drive.folder}/{ENTRY}", json.dumps(asdict(entry), indent=1).encode())


def failed_row(drive: Drive, sentence: str, seconds: float = 0.0, recording: str = "") -> Row:
    """The row of a drive that failed."""
    return row_of(drive, verdict=FAILED, reason=sentence, seconds=seconds, recording=recording)


def word_counts(rows: Sequence[Row]) -> str:
    """The number of drives with each `Row.word`, in words."""
    counts = {word: sum(row.word == word for row in rows) for word in reversed(ORDER)}
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count) or "none"


def joint_verdicts(rows: Sequence[Row]) -> str:
    """The number of verdicts that need the other drives of the car, in words; empty for none."""
    count = sum(row.word != row.verdict for row in rows)
    return f"{count} of these verdicts come from all drives of the car together." if count else ""
