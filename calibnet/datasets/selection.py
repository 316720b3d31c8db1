"""Choosing frames of a sequence by text, as the command line does."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sized
from collections.abc import Sequence as Positions

from calibnet.datasets.frame import Frame, Sequence, index_of
from calibnet.errors import ConfigError, DatasetError

_NUMBER = r"([+-]?\d+)"
_PATTERN = re.compile(rf"\s*(?:{_NUMBER}|{_NUMBER}?:{_NUMBER}?(?::{_NUMBER}?)?)\s*")


def select_frames(sequence: Sized, text: str = ":") -> list[int]:
    """Positions in ``sequence`` that ``text`` selects.

    Args:
        sequence: anything with a length.
        text: one position, ``"7"``, or a Python slice of positions, ``"0:100:5"``; negative ones
            count from the end.

    Raises:
        ConfigError: ``text`` is neither a position nor a slice.
        DatasetError: it selects no frame of this sequence.
    """
    match = _PATTERN.fullmatch(text)
    if match is None:
        raise ConfigError(f"Frames {text!r} are not a position or START:STOP:STEP; write for instance 7 or 0:100:5.")
    position, *bounds = (None if number is None else int(number) for number in match.groups())
    if bounds[2] == 0:
        raise ConfigError(f"Frames {text!r} have a step of 0; write for instance 0:100:5.")
    count = len(sequence)
    if position is None:
        selected = list(range(count)[slice(*bounds)])
    else:
        selected = [position % count] if -count <= position < count else []
    if not selected:
        name = getattr(sequence, "name", "the sequence")
        raise DatasetError(
            f"Frames {text!r} select nothing of {name}; choose from its {count} frames (0 to {count - 1})."
        )
    return selected


def evenly_spaced(count: int, most: int) -> list[int]:
    """At most ``most`` of the positions 0 to ``count - 1``, evenly spread, the last always among them."""
    chosen = min(count, most)
    return [(number + 1) * count // chosen - 1 for number in range(chosen)]


def by_rig(sequences: Iterable[Sequence]) -> dict[str, list[Sequence]]:
    """Sequences by `Sequence.rig`, in the order in which rigs appear."""
    found: dict[str, list[Sequence]] = {}
    for sequence in sequences:
        found.setdefault(sequence.rig, []).append(sequence)
    return found


class PickedFrames:
    """A `Sequence` of some positions of another."""

    def __init__(self, sequence: Sequence, positions: Positions[int]) -> None:
        self.sequence, self.positions = sequence, positions
        self.name, self.rig = sequence.name, sequence.rig

    def __len__(self) -> int:
        return len(self.positions)

    def index_of(self, position: int) -> int:
        """The number of the frame at one of the chosen positions."""
        return index_of(self.sequence, self.positions[position])

    def __getitem__(self, position: int) -> Frame:
        """Read the frame at one of the chosen positions."""
        return self.sequence[self.positions[position]]

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(len(self)))
