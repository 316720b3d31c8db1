"""Tests whether a calibrator uses the image: the same frames with another image, a grey one, or fewer LiDAR rings.

A regressor can memorise a rig from the LiDAR's ring pattern alone and have small errors on it. Such a calibrator is as
good with a grey image; one that matches the image to the scan fails without the true image.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from calibnet.datasets import Frame, Sequence
from calibnet.datasets.images.files import resize_image

RING_DEG = 0.8
"""Degrees of elevation of a kept and a dropped band together: of 64 beams about 32 are left."""

Alteration = Callable[[Frame], Frame]


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


def grey(frame: Frame) -> Frame:
    """The frame with nothing to see."""
    return replace(frame, image=np.full_like(frame.image, 128))


def thinned(frame: Frame) -> Frame:
    """The frame with every other band of elevation, as a scanner with half the beams would see it."""
    elevation = np.degrees(np.arctan2(frame.points[:, 2], np.hypot(frame.points[:, 0], frame.points[:, 1])))
    return replace(frame, points=frame.points[elevation % RING_DEG < RING_DEG / 2])


def swapped_with(donors: Sequence) -> Alteration:
    """Replace images by those of another drive in turn, resized to fit."""

    def swap(frame: Frame) -> Frame:
        return replace(frame, image=resize_image(donors[frame.index % len(donors)].image, frame.camera))

    return swap


def alterations(donors: Sequence) -> dict[str, Alteration]:
    """The alterations by the names that tables and JSON use."""
    return {"swapped": swapped_with(donors), "grey": grey, "thinned": thinned}


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
