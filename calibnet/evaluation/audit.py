"""Tests whether a calibrator uses the image: the same frames with another image, a grey one, or fewer LiDAR rings.

A regressor can memorise a rig from the LiDAR's ring pattern alone and have small errors on it. Such a calibrator is as
good with a grey image; one that matches the image to the scan fails without the true image.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

from calibnet.datasets import Frame, Sequence
from calibnet.datasets.images.files import resize_image
from calibnet.evaluation.faults import Alteration, grey, thinned


class Altered:
    """A `Sequence` whose frames are altered as they are read."""

    def __init__(self, sequence: Sequence, alter: Alteration) -> None:
        self.sequence, self.alter = sequence, alter
        self.name, self.rig = sequence.name, sequence.rig

    def __len__(self) -> int:
        return len(self.sequence)

    def __getitem__(self, position: int) -> Frame:
        """Read and alter one frame."""
        return self.sequence[position].changed(self.alter)

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(len(self)))


def swapped_with(donors: Sequence) -> Alteration:
    """Replace images by those of another drive in turn, resized to fit."""

    def swap(frame: Frame) -> Frame:
        return replace(frame, image=resize_image(donors[frame.index % len(donors)].image, frame.camera))

    return swap


def alterations(donors: Sequence) -> dict[str, Alteration]:
    """The alterations by the names that tables and JSON use."""
    return {"swapped": swapped_with(donors), "grey": grey, "thinned": thinned(2)}


def other_drive(sequence: Sequence, opened: list[Sequence], beside: Callable[[], Iterable[Sequence]]) -> Sequence:
    """Another drive, for its images.

    Args:
        sequence: the sequence whose images will be replaced.
        opened: sequences that are open already.
        beside: opens further sequences of the dataset's folder, one after the other.

    Returns:
        The first of these that is another drive, otherwise a drive through the synthetic world.
    """
    for candidate in chain(opened, beside()):
        if Path(candidate.name).name != Path(sequence.name).name:
            return candidate
    from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence

    return SyntheticSequence(seed=1, length=4, rig=KITTI_LIKE)
