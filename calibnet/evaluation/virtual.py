"""Virtual rigs: the frames of a sequence as another camera, turned another way, and another scanner would have them.

A figure on one rig says little of other rigs, and there are few. The picture is turned about the camera's centre and
cut to a narrower lens, which moves no parallax and is exact, and half of the rigs have half of the rings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from calibnet.cascade.upright import turned
from calibnet.datasets.frame import Frame
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.evaluation.faults import thinned
from calibnet.geometry import PinholeCamera, rotation_from_euler_xyz, transform

NARROWEST = 1.6
"""Largest factor on the focal length; a wider lens would show what the picture does not have."""
OFF_CENTRE = 0.1
"""Share of the picture by which the part that is kept may lie beside its middle."""
MOST_PITCH_DEG, MOST_YAW_DEG, MOST_ROLL_DEG = 4.0, 10.0, 5.0
"""Largest angles by which the camera is turned, either way."""
RESIZED = (0.6, 1.2)
"""Pixels of the virtual camera, relative to those of the part that it shows."""


@dataclass(frozen=True)
class VirtualRig:
    """Another camera and scanner in the place of the real ones.

    Attributes:
        zoom: times the focal length, by cropping.
        beside: shares of the picture (right, down) by which the cut lies beside the middle.
        turn_deg: pitch, yaw and roll of the camera against the real one.
        resized: pixels, relative to those that are left.
        thinned: every second ring alone.
    """

    zoom: float
    beside: tuple[float, float]
    turn_deg: tuple[float, float, float]
    resized: float
    thinned: bool

    @classmethod
    def drawn(cls, seed: int, number: int) -> VirtualRig:
        """The rig of a number; every second one is thinned."""
        generator = np.random.default_rng([seed, number])
        right, down = generator.uniform(-OFF_CENTRE, OFF_CENTRE, 2)
        pitch, yaw, roll = generator.uniform(-1, 1, 3) * (MOST_PITCH_DEG, MOST_YAW_DEG, MOST_ROLL_DEG)
        zoom, size = generator.uniform(1.0, NARROWEST), generator.uniform(*RESIZED)
        turn = (float(pitch), float(yaw), float(roll))
        return cls(float(zoom), (float(right), float(down)), turn, float(size), number % 2 == 1)

    def __call__(self, frame: Frame) -> Frame:
        """A frame as this rig has it; its extrinsic is still the truth."""
        rotation = rotation_from_euler_xyz(np.radians(self.turn_deg))
        image, camera = turned(frame.image, frame.camera, rotation)
        width, height = round(camera.width / self.zoom), round(camera.height / self.zoom)
        left = round((camera.width - width) / 2 + self.beside[0] * camera.width)
        top = round((camera.height - height) / 2 + self.beside[1] * camera.height)
        left, top = min(max(left, 0), camera.width - width), min(max(top, 0), camera.height - height)
        matrix = camera.matrix.copy()
        matrix[:2, 2] -= left, top
        cut = PinholeCamera(width, height, matrix)
        small = cut.resized(round(width * self.resized), round(height * self.resized))
        shown = np.ascontiguousarray(image[top : top + height, left : left + width])
        seen = replace(
            frame,
            image=np.asarray(cv2.resize(shown, (small.width, small.height), interpolation=cv2.INTER_AREA), np.uint8),
            camera=small,
            camera_from_lidar=transform(rotation, np.zeros(3)) @ frame.camera_from_lidar,
            original=None,
            faces=(),
        )
        return thinned(2)(seen) if self.thinned else seen


class Virtual:
    """A sequence as a virtual rig has it."""

    def __init__(self, sequence: FrameSequence, number: int, seed: int) -> None:
        """The rig of a number, the same for all frames."""
        self.sequence, self.virtual = sequence, VirtualRig.drawn(seed, number)
        self.name = f"{sequence.name}, virtual rig {number}"
        thinner = ", half the rings" if self.virtual.thinned else ""
        self.rig = f"{sequence.rig} {self.virtual.zoom:.2f} times as narrow, turned{thinner}"

    def __len__(self) -> int:
        return len(self.sequence)

    def __getitem__(self, position: int) -> Frame:
        """Read one frame."""
        return self.virtual(self.sequence[position])

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(len(self)))


def virtual_rigs(sequences: list[FrameSequence], count: int, seed: int) -> list[FrameSequence]:
    """So many virtual rigs of every sequence."""
    return [
        Virtual(sequence, count * position + number, seed)
        for position, sequence in enumerate(sequences)
        for number in range(count)
    ]
