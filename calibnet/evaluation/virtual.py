"""Virtual rigs: the frames of a sequence as seen by a rotated camera with another lens, and by another scanner.

Figures on one rig say little about other rigs, of which there are few. The image is rotated about the camera's centre
and cropped to a narrower lens, which is exact as it causes no parallax. Half of the rigs have half of the rings.
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
"""Largest factor on the focal length; the smallest is 1, as the image does not have more than the lens saw."""
OFF_CENTRE = 0.1
"""Largest offset of the crop from the middle, as a share of the image."""
MOST_PITCH_DEG, MOST_YAW_DEG, MOST_ROLL_DEG = 4.0, 10.0, 5.0
"""Largest angles by which the camera is turned, either way."""
RESIZED = (0.6, 1.2)
"""Smallest and largest width of the virtual camera's image, relative to that of the crop."""


@dataclass(frozen=True)
class VirtualRig:
    """Another camera and scanner in the place of the real ones.

    Attributes:
        zoom: factor on the focal length, by cropping.
        beside: offset (right, down) of the crop from the middle, as shares of the image.
        turn_deg: pitch, yaw and roll of the camera relative to the real one.
        resized: width of the image relative to that of the crop.
        thinned: whether only every second ring is kept.
    """

    zoom: float
    beside: tuple[float, float]
    turn_deg: tuple[float, float, float]
    resized: float
    thinned: bool

    @classmethod
    def drawn(cls, seed: int, number: int) -> VirtualRig:
        """Draw the rig with a number; every second rig is thinned."""
        generator = np.random.default_rng([seed, number])
        right, down = generator.uniform(-OFF_CENTRE, OFF_CENTRE, 2)
        pitch, yaw, roll = generator.uniform(-1, 1, 3) * (MOST_PITCH_DEG, MOST_YAW_DEG, MOST_ROLL_DEG)
        zoom, size = generator.uniform(1.0, NARROWEST), generator.uniform(*RESIZED)
        turn = (float(pitch), float(yaw), float(roll))
        return cls(float(zoom), (float(right), float(down)), turn, float(size), number % 2 == 1)

    def __call__(self, frame: Frame) -> Frame:
        """A frame as seen by this rig; its extrinsic is still the truth."""
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
    """A sequence as seen by a virtual rig."""

    def __init__(self, sequence: FrameSequence, number: int, seed: int) -> None:
        """See all frames of ``sequence`` by the rig with this number."""
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
    """Every sequence as seen by ``count`` virtual rigs."""
    return [
        Virtual(sequence, count * position + number, seed)
        for position, sequence in enumerate(sequences)
        for number in range(count)
    ]
