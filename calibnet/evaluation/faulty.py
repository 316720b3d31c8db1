"""A drive with one of the battery's faults in all frames, or on two mounts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache

from calibnet.datasets.frame import Frame
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.errors import DatasetError
from calibnet.evaluation.corruptions import Corruption, corruptions, two_mounts
from calibnet.geometry import PoseError, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.verdict import DRIVE_LIMITS


class Faulty:
    """A drive with a fault in its frames; a frame that the fault cannot be applied to is unreadable."""

    def __init__(
        self, sequence: FrameSequence, positions: list[int], fault: Corruption | None, donors: list[Frame]
    ) -> None:
        self.sequence, self.positions, self.fault, self.donors = sequence, positions, fault, donors
        self.read = lru_cache(len(positions))(self._read)

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, number: int) -> Frame:
        """The frame of this number, with the fault."""
        return self.read(number)

    def _read(self, number: int) -> Frame:
        position = self.positions[number]
        frame = self.sequence[position]
        if self.fault is None:
            return frame
        for fault in self._faults(number):
            if (fault.name, fault.strength) == (self.fault.name, self.fault.strength):
                return fault.put(frame)
        raise DatasetError(
            f"The fault {self.fault.name} cannot be applied to frame {position} of {self.sequence.name}."
        )

    def _faults(self, number: int) -> Iterable[Corruption]:
        yield from corruptions(self.sequence, self.positions[number], self.donors)
        yield from two_mounts(second=2 * number >= len(self.positions))


def farthest(extrinsic: Extrinsic, drive: Faulty) -> PoseError:
    """The largest error against the frames of a drive, relative to `DRIVE_LIMITS`; they may be on different mounts."""
    truths = {frame.camera_from_lidar.tobytes(): frame.camera_from_lidar for frame in readable(drive)}
    errors = [pose_error(extrinsic, truth) for truth in truths.values()]
    return max(errors, key=lambda one: one.translation_cm / DRIVE_LIMITS[1] + one.rotation_deg / DRIVE_LIMITS[0])


def readable(drive: Faulty) -> Iterator[Frame]:
    """The frames of a drive that can be read."""
    for number in range(len(drive)):
        try:
            yield drive[number]
        except DatasetError:
            continue
