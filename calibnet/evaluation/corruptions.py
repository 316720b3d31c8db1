"""The faults of the battery: readable but wrong input, in several strengths, each with its true cause.

The ``camera_from_lidar`` of a frame with a fault is still the truth: a fault that turns the camera turns it too. The
guess from which a frame is calibrated does not depend on the fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.datasets.synthetic.sequence import SyntheticSequence
from calibnet.evaluation import faults
from calibnet.evaluation.faults import Alteration


@dataclass(frozen=True)
class Corruption:
    """One fault at one strength.

    Attributes:
        name: name of the fault, the same at all strengths.
        strength: strength for tables; empty for a fault that has only one.
        cause: name of the cause that a verdict should give; None if there is no such cause.
        alter: puts the fault into a frame.
        middle: whether causes are counted at this strength.
        farther: factor on the range of the guess.
    """

    name: str
    strength: str
    cause: str | None
    alter: Alteration
    middle: bool = True
    farther: float = 1.0

    def put(self, frame: Frame) -> Frame:
        """A frame with the fault, without the faces of a wide lens, as a fault is one of a single image."""
        return self.alter(replace(frame, faces=()))


def corruptions(sequence: FrameSequence, position: int, donors: Sequence[Frame]) -> Iterator[Corruption]:
    """All faults that can be put into the frame at a position of a sequence.

    Args:
        sequence: the sequence of the frame. Late scans need neighbouring frames, and accumulated scans the car's true
            motion, which only the synthetic world has.
        position: position of the frame.
        donors: frames of other places, for their images.
    """
    yield from image_faults(donors)
    yield from camera_faults()
    yield from scan_faults()
    for late in (1, -1, 4, -4):
        if 0 <= position + late < len(sequence):
            yield Corruption(
                "late-scan", f"{late:+d}", "time-offset", faults.scan_at(sequence, position + late), late == 1
            )
    if isinstance(sequence, SyntheticSequence):
        for count in (3, 5, 10):
            if count <= len(sequence):
                yield Corruption(
                    "accumulated", f"{count}", "accumulated", faults.accumulated(sequence, position, count), count == 5
                )
    for factor in (2.0, 3.0, 4.0):
        yield Corruption("far-start", f"x{factor:g}", None, faults.unaltered, factor == 3.0, farther=factor)


def image_faults(donors: Sequence[Frame]) -> Iterator[Corruption]:
    """Faults of the image."""
    for number, donor in enumerate(donors):
        yield Corruption("other-picture", f"{number + 1}", "other-picture", faults.image_of(donor), number == 0)
    yield Corruption("grey", "", None, faults.grey)
    for pixels in (2.0, 5.0, 10.0):
        yield Corruption("blurred", f"{pixels:g} px", None, faults.blurred(pixels), pixels == 5)
    for gain in (2.0, 4.0, 8.0):
        yield Corruption("over-exposed", f"x{gain:g}", None, faults.exposed(gain), gain == 4)
    yield Corruption("mirrored", "", "mirrored", faults.mirrored)
    for degrees in (5.0, -10.0, 20.0, -30.0, 45.0, 90.0, 180.0):
        yield Corruption("rolled", f"{degrees:g} deg", "roll", faults.rolled(degrees), degrees in (-30, 90))
    for pixels in (20.0, -60.0, 120.0):
        yield Corruption("shifted", f"{pixels:+g} px", "principal-point", faults.shifted(pixels, 0.0), pixels == -60)
    for bits in (14, 12, 10):
        yield Corruption("high-byte", f"{bits} bits", "bit-depth", faults.high_byte(bits), bits == 12)
    yield Corruption("low-byte", "12 bits", "bit-depth", faults.low_byte(12))


def camera_faults() -> Iterator[Corruption]:
    """Faults of the camera's intrinsics."""
    for percent in (2, -2, 5, -5, 10, -10):
        yield Corruption(
            "focal-length", f"{percent:+d} %", "focal-length", faults.focal(1 + percent / 100), abs(percent) == 5
        )
    for pixels in ((20.0, 0.0), (-20.0, 0.0), (60.0, 0.0), (-60.0, 0.0), (0.0, 60.0)):
        strength = f"{pixels[0]:+g}, {pixels[1]:+g} px"
        yield Corruption(
            "principal-point", strength, "principal-point", faults.principal(*pixels), abs(pixels[0]) == 60
        )
    for factor in (0.75, 0.5, 2.0):
        yield Corruption("other-size", f"x{factor:g}", "picture-size", faults.matrix_of_size(factor), factor == 0.5)
    for k1 in (-0.1, -0.2, -0.35, 0.1):
        yield Corruption("distorted", f"k1 {k1:g}", "distortion", faults.distorted(k1), k1 == -0.2)
    yield Corruption("equidistant", "", "lens-model", faults.equidistant)


def scan_faults() -> Iterator[Corruption]:
    """Faults of the scan."""
    for share in (2, 4, 8):
        yield Corruption("thinned", f"1 of {share}", None, faults.thinned(share), share == 4)
    yield Corruption("half-missing", "", None, faults.half_missing)
    for metres in (0.05, 0.1, 0.3):
        yield Corruption("noise", f"{metres:g} m", None, faults.noisy(metres), metres == 0.1)
    for name, factor in (("feet", 1 / 0.3048), ("millimetres", 1000.0), ("kilometres", 0.001)):
        yield Corruption("units", name, "units", faults.scaled_scan(factor), name == "millimetres")
    for name, order in faults.AXIS_CONVENTIONS.items():
        yield Corruption("axes", name, "axes", faults.turned(order), name == "x right, y down, z forward")
    for name, axis in (("y to the right", 1), ("x backward", 0), ("z down", 2)):
        yield Corruption("left-handed", name, "left-handed", faults.flipped(axis), axis == 1)
    yield Corruption("intensity", "constant", None, faults.reflecting(lambda values: np.full_like(values, 0.5)), False)
    yield Corruption("intensity", "none", None, faults.reflecting(np.zeros_like))
    yield Corruption("intensity", "one glint", None, faults.reflecting(faults.glint), False)


def two_mounts(second: bool) -> Iterator[Corruption]:
    """A drive on two mounts: the LiDAR is turned and moved in its second half.

    Args:
        second: whether the frame is in the second half; frames of the first half are unaltered.
    """
    for degrees, metres in ((0.5, 0.0), (1.0, 0.1), (3.0, 0.3)):
        alter = faults.remounted(degrees, metres) if second else faults.unaltered
        yield Corruption("two-mounts", f"{degrees:g} deg, {100 * metres:g} cm", None, alter, degrees == 1.0)
