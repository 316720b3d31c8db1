"""What can be wrong with input that can still be read: each fault as a function of a frame, with its true cause.

A fault leaves the frame's ``camera_from_lidar`` the truth: where it turns the camera, the truth turns too. What a user
would start from, the guess, does not know of the fault.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.datasets.images import resize_image
from calibnet.datasets.synthetic.sequence import SyntheticSequence
from calibnet.geometry import PinholeCamera, invert, rotation_from_euler_xyz, transform, transform_points
from calibnet.geometry.types import Transform

NATIVE_WIDTH = 1242
"""Width of the picture whose pixels strengths are given in; in another one, as many of its own in proportion."""
BAND_DEG = 0.4
"""Degrees of elevation that are kept or dropped together when a scan is thinned: about a ring of 64."""

Alteration = Callable[[Frame], Frame]


@dataclass(frozen=True)
class Corruption:
    """One fault at one strength.

    Attributes:
        name: of the fault; the same for all its strengths.
        strength: how much of it, for tables; empty where there is no more or less of it.
        cause: name of the cause that a verdict should give, or None where there is none to give.
        alter: puts it into a frame.
        middle: whether causes are counted at this strength.
        farther: by what the range of the start is multiplied.
    """

    name: str
    strength: str
    cause: str | None
    alter: Alteration
    middle: bool = True
    farther: float = 1.0


def corruptions(sequence: FrameSequence, position: int, donors: Sequence[Frame]) -> Iterator[Corruption]:
    """All faults that can be put into the frame at a position of a sequence.

    Args:
        sequence: neighbours come from there; without them there is no late scan, and without known motion, which the
            synthetic world has, no scan put together of several.
        position: of the frame.
        donors: frames of other places, for their pictures.
    """
    frame = sequence[position]
    yield from picture_faults(frame, donors)
    yield from camera_faults()
    yield from scan_faults(frame)
    for late in (1, -1, 4, -4):
        if 0 <= position + late < len(sequence):
            yield Corruption("late-scan", f"{late:+d}", "time-offset", scan_of(sequence[position + late]), late == 1)
    if isinstance(sequence, SyntheticSequence):
        for count in (3, 5, 10):
            if count <= len(sequence):
                yield Corruption(
                    "accumulated", f"{count}", "accumulated", accumulated(sequence, position, count), count == 5
                )
    for factor in (2.0, 3.0, 4.0):
        yield Corruption("far-start", f"x{factor:g}", None, unaltered, factor == 3.0, farther=factor)


def picture_faults(frame: Frame, donors: Sequence[Frame]) -> Iterator[Corruption]:
    """Faults of what the picture shows."""
    for number, donor in enumerate(donors):
        yield Corruption("other-picture", f"{number + 1}", "other-picture", picture_of(donor), number == 0)
    yield Corruption("grey", "", None, grey)
    for pixels in (2.0, 5.0, 10.0):
        yield Corruption("blurred", f"{pixels:g} px", None, blurred(pixels), pixels == 5)
    for gain in (2.0, 4.0, 8.0):
        yield Corruption("over-exposed", f"x{gain:g}", None, exposed(gain), gain == 4)
    yield Corruption("mirrored", "", "mirrored", mirrored)
    for degrees in (5.0, -10.0, 20.0, -30.0, 45.0, 90.0, 180.0):
        yield Corruption("rolled", f"{degrees:g} deg", "roll", rolled(degrees), degrees in (-30, 90))
    for pixels in (20.0, -60.0, 120.0):
        yield Corruption("shifted", f"{pixels:+g} px", "principal-point", shifted(pixels, 0.0), pixels == -60)
    for bits in (14, 12, 10):
        yield Corruption("high-byte", f"{bits} bits", "bit-depth", high_byte(bits), bits == 12)
    yield Corruption("low-byte", "12 bits", "bit-depth", low_byte(12, frame.index))


def camera_faults() -> Iterator[Corruption]:
    """Faults of what is said of the camera."""
    for percent in (2, -2, 5, -5, 10, -10):
        yield Corruption("focal-length", f"{percent:+d} %", "focal-length", focal(1 + percent / 100), abs(percent) == 5)
    for pixels in ((20.0, 0.0), (-20.0, 0.0), (60.0, 0.0), (-60.0, 0.0), (0.0, 60.0)):
        strength = f"{pixels[0]:+g}, {pixels[1]:+g} px"
        yield Corruption("principal-point", strength, "principal-point", principal(*pixels), abs(pixels[0]) == 60)
    for factor in (0.75, 0.5, 2.0):
        yield Corruption("other-size", f"x{factor:g}", "picture-size", matrix_of_size(factor), factor == 0.5)
    for k1 in (-0.1, -0.2, -0.35, 0.1):
        yield Corruption("distorted", f"k1 {k1:g}", "distortion", distorted(k1), k1 == -0.2)
    yield Corruption("equidistant", "", "lens-model", equidistant)


def scan_faults(frame: Frame) -> Iterator[Corruption]:
    """Faults of the scan itself."""
    for share in (2, 4, 8):
        yield Corruption("thinned", f"1 of {share}", None, thinned(share), share == 4)
    yield Corruption("half-missing", "", None, half_missing)
    for metres in (0.05, 0.1, 0.3):
        yield Corruption("noise", f"{metres:g} m", None, noisy(metres, frame.index), metres == 0.1)
    for name, factor in (("feet", 1 / 0.3048), ("millimetres", 1000.0), ("kilometres", 0.001)):
        yield Corruption("units", name, "units", scaled_scan(factor), name == "millimetres")
    for name, order in AXES.items():
        yield Corruption("axes", name, "axes", turned(order), name == "x right, y down, z forward")
    for name, axis in (("y to the right", 1), ("x backward", 0), ("z down", 2)):
        yield Corruption("left-handed", name, "left-handed", flipped(axis), axis == 1)
    yield Corruption("intensity", "constant", None, reflecting(lambda values: np.full_like(values, 0.5)), False)
    yield Corruption("intensity", "none", None, reflecting(np.zeros_like))
    yield Corruption("intensity", "one glint", None, reflecting(glint), False)


AXES = {
    "x right, y forward, z up": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "x right, y down, z forward": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "x backward, y right, z up": np.diag([-1.0, -1.0, 1.0]),
}
"""Axes in which other software gives scans, and the rotation of a scan (x forward, y left, z up) into them."""


def unaltered(frame: Frame) -> Frame:
    """The frame as it is."""
    return frame


def grey(frame: Frame) -> Frame:
    """Nothing to see."""
    return replace(frame, image=np.full_like(frame.image, 128))


def picture_of(donor: Frame) -> Alteration:
    """The picture of another frame, fitted to the size."""
    return lambda frame: replace(frame, image=resize_image(donor.image, frame.camera))


def blurred(pixels: float) -> Alteration:
    """Blur the picture by a Gaussian of so many native pixels."""

    def alter(frame: Frame) -> Frame:
        sigma = pixels * frame.camera.width / NATIVE_WIDTH
        return replace(frame, image=np.asarray(cv2.GaussianBlur(frame.image, (0, 0), sigma), np.uint8))

    return alter


def exposed(gain: float) -> Alteration:
    """Expose the picture so many times as long; what is too bright is white."""
    return lambda frame: replace(frame, image=np.minimum(frame.image * np.float32(gain), 255).astype(np.uint8))


def mirrored(frame: Frame) -> Frame:
    """Left and right of the picture exchanged."""
    return replace(frame, image=np.ascontiguousarray(frame.image[:, ::-1]))


def rolled(degrees: float) -> Alteration:
    """Turn the picture clockwise about the principal point, and the true camera with it."""

    def alter(frame: Frame) -> Frame:
        turn = rotation_from_euler_xyz([0.0, 0.0, np.radians(degrees)])
        matrix, size = frame.camera.matrix, (frame.camera.width, frame.camera.height)
        image = cv2.warpPerspective(frame.image, matrix @ turn @ np.linalg.inv(matrix), size, flags=cv2.INTER_LINEAR)
        truth = transform(turn, np.zeros(3)) @ frame.camera_from_lidar
        return replace(frame, image=image.astype(np.uint8, copy=False), camera_from_lidar=truth)

    return alter


def shifted(right: float, down: float) -> Alteration:
    """Move what the picture shows by so many native pixels."""

    def alter(frame: Frame) -> Frame:
        size, scale = (frame.camera.width, frame.camera.height), frame.camera.width / NATIVE_WIDTH
        motion = np.array([[1.0, 0.0, right * scale], [0.0, 1.0, down * scale]])
        return replace(frame, image=cv2.warpAffine(frame.image, motion, size).astype(np.uint8, copy=False))

    return alter


def high_byte(bits: int) -> Alteration:
    """A picture of so many bits, stored in 16, of which the high byte is read: almost black."""
    return lambda frame: replace(frame, image=frame.image >> np.uint8(16 - bits))


def low_byte(bits: int, seed: int) -> Alteration:
    """A picture of so many bits of which the low byte is read: brightness goes round and round."""

    def alter(frame: Frame) -> Frame:
        steps = 1 << (bits - 8)
        fraction = np.random.default_rng(seed).integers(0, steps, frame.image.shape)
        return replace(frame, image=((frame.image.astype(np.int64) * steps + fraction) & 255).astype(np.uint8))

    return alter


def with_matrix(frame: Frame, change: NDArray[np.float64]) -> Frame:
    """The frame whose camera is said to have the matrix ``change @ matrix``."""
    camera = frame.camera
    return replace(frame, camera=PinholeCamera(camera.width, camera.height, change @ camera.matrix))


def focal(factor: float) -> Alteration:
    """Say that the focal length is so many times the true one."""

    def alter(frame: Frame) -> Frame:
        matrix = frame.camera.matrix.copy()
        matrix[:2, :2] *= factor
        return replace(frame, camera=PinholeCamera(frame.camera.width, frame.camera.height, matrix))

    return alter


def principal(right: float, down: float) -> Alteration:
    """Say that the principal point lies so many native pixels from the true one."""

    def alter(frame: Frame) -> Frame:
        scale = frame.camera.width / NATIVE_WIDTH
        return with_matrix(frame, np.array([[1.0, 0.0, right * scale], [0.0, 1.0, down * scale], [0.0, 0.0, 1.0]]))

    return alter


def matrix_of_size(factor: float) -> Alteration:
    """Give the matrix of the picture resized by a factor."""

    def alter(frame: Frame) -> Frame:
        width, height = round(factor * frame.camera.width), round(factor * frame.camera.height)
        matrix = frame.camera.resized(width, height).matrix
        return replace(frame, camera=PinholeCamera(frame.camera.width, frame.camera.height, matrix))

    return alter


def distorted(k1: float) -> Alteration:
    """The picture of a lens of this radial distortion, not undone."""

    def alter(frame: Frame) -> Frame:
        return relensed(frame, lambda radius: radius * (1 + k1 * radius**2))

    return alter


def equidistant(frame: Frame) -> Frame:
    """The picture of a fisheye lens, whose small coefficients were taken for those of an ordinary one."""
    return relensed(frame, np.arctan)


def relensed(frame: Frame, bend: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Frame:
    """The picture of a lens that shows at ``bend(r)`` what a pinhole shows at ``r`` (tangents of angles, [N]).

    Cut to the rectangle that it fills, as a user's picture is full; the matrix goes along.
    """
    camera = frame.camera
    (fx, fy), (cx, cy) = camera.focal, camera.center
    # the inverse by a table, as far as the lens is one to one
    pinhole = np.linspace(0.0, 3.0, 3001)
    seen = bend(pinhole)
    rising = int(np.argmax(np.diff(seen) <= 0)) or len(seen)
    pinhole, seen = pinhole[:rising], seen[:rising]
    edges = np.array([-cx, camera.width - 1 - cx]) / fx, np.array([-cy, camera.height - 1 - cy]) / fy
    corner_x, corner_y = (grid.ravel() for grid in np.meshgrid(*edges))
    corners = np.hypot(corner_x, corner_y)
    share = min(1.0, float((np.interp(corners, pinhole, seen) / corners).min()))
    left, top = (int(np.ceil(centre - share * centre)) for centre in (cx, cy))
    width, height = int(share * (camera.width - 1)), int(share * (camera.height - 1))
    v, u = np.mgrid[top : top + height, left : left + width].astype(np.float64)
    x, y = (u - cx) / fx, (v - cy) / fy
    radius = np.hypot(x, y)
    stretch = np.interp(radius, seen, pinhole) / np.maximum(radius, 1e-9)
    maps = ((fx * x * stretch + cx).astype(np.float32), (fy * y * stretch + cy).astype(np.float32))
    image = cv2.remap(frame.image, *maps, cv2.INTER_LINEAR).astype(np.uint8, copy=False)
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= left, top
    return replace(frame, image=image, camera=PinholeCamera(width, height, matrix))


def with_positions(frame: Frame, positions: NDArray[np.floating]) -> Frame:
    """The frame with its points elsewhere, ``[N, 3]``."""
    return replace(frame, points=np.column_stack([positions, frame.points[:, 3]]).astype(np.float32))


def thinned(share: int) -> Alteration:
    """Keep one band of elevation of so many, as a scanner with fewer beams would."""

    def alter(frame: Frame) -> Frame:
        elevation = np.degrees(np.arctan2(frame.points[:, 2], np.hypot(frame.points[:, 0], frame.points[:, 1])))
        return replace(frame, points=frame.points[elevation % (share * BAND_DEG) < BAND_DEG])

    return alter


def half_missing(frame: Frame) -> Frame:
    """No point in the left half of what the camera sees."""
    across = transform_points(frame.camera_from_lidar, frame.points[:, :3])[:, 0]
    return replace(frame, points=frame.points[across > 0])


def noisy(metres: float, seed: int) -> Alteration:
    """Points nearer or farther by a Gaussian of so many metres."""

    def alter(frame: Frame) -> Frame:
        positions = frame.points[:, :3].astype(np.float64)
        distance = np.maximum(np.linalg.norm(positions, axis=1, keepdims=True), 1e-6)
        error = np.random.default_rng(seed).normal(0.0, metres, (len(positions), 1))
        return with_positions(frame, positions * (1 + error / distance))

    return alter


def scaled_scan(factor: float) -> Alteration:
    """The scan in another unit."""
    return lambda frame: with_positions(frame, frame.points[:, :3] * factor)


def turned(rotation: NDArray[np.float64]) -> Alteration:
    """The scan in other axes."""
    return lambda frame: with_positions(frame, frame.points[:, :3] @ rotation.T)


def flipped(axis: int) -> Alteration:
    """The scan with one axis the other way round, so that its axes are left-handed."""
    sign = np.where(np.arange(3) == axis, -1.0, 1.0)
    return lambda frame: with_positions(frame, frame.points[:, :3] * sign)


def reflecting(change: Callable[[NDArray[np.float32]], NDArray[np.float32]]) -> Alteration:
    """The scan with other intensities."""

    def alter(frame: Frame) -> Frame:
        return replace(frame, points=np.column_stack([frame.points[:, :3], change(frame.points[:, 3])]))

    return alter


def glint(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Intensities scaled to one reflection that is 200 times as bright."""
    faint = values / np.float32(200)
    faint[:1] = 1.0
    return faint


def scan_of(other: Frame) -> Alteration:
    """The scan of another moment."""
    return lambda frame: replace(frame, points=other.points)


def accumulated(sequence: SyntheticSequence, position: int, count: int) -> Alteration:
    """So many scans around a position, put together by where the car was."""
    first = min(max(0, position - count // 2), len(sequence) - count)

    def world_from_lidar(at: int) -> Transform:
        return sequence.world_from_vehicle(at) @ sequence.mount.vehicle_from_lidar

    def alter(frame: Frame) -> Frame:
        here = invert(world_from_lidar(position))
        parts = []
        for at in range(first, first + count):
            points = frame.points if at == position else sequence[at].points
            moved = transform_points(here @ world_from_lidar(at), points[:, :3])
            parts.append(np.column_stack([moved, points[:, 3]]))
        return replace(frame, points=np.concatenate(parts).astype(np.float32))

    return alter
