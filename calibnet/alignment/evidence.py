"""The evidence of one frame for its extrinsic, without training.

Depth edges, after Levinson & Thrun, "Automatic online calibration of cameras and lasers" (2013): points beside which
the depth jumps farther belong on edges of the image. Edges of reflectance (road markings, signs, plates) belong there
too. Reflectance as a whole, after Pandey et al., "Automatic targetless extrinsic calibration" (2012), and Koide et al.,
"General, single-shot, target-less" (2023): reflectance and brightness depend on each other most where scan and image
fit, which the normalised information distance measures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.alignment.pull import Map
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.geometry import PinholeCamera, invert, project, transform
from calibnet.geometry.projection import nearest_per_cell
from calibnet.geometry.types import Extrinsic, Floats, Transform, Vector6

HEIGHT, WIDTH = 320, 1024
"""The image is resized to the area of this size, its aspect kept; lengths in pixels below are those of the result."""
BLUR = 2.0
"""Standard deviation, in pixels, of the blur of edges, which is how far they attract; less than a network's cell."""
BRIGHTNESS_BLUR = 2.5
"""Standard deviation, in pixels, of the blur of the brightness that reflectance is compared with; finer detail would
give the cost local minima."""
SURROUNDINGS = 61
"""Side, in pixels, of the square whose mean contrast the strength of an edge is relative to."""
FAINTEST, SHARPEST = 1.0, 4.0
"""Grey levels per pixel that are added to the mean contrast, so that noise in a plain area is no edge; and the
strength, as a multiple of the mean contrast, at which edges are clipped."""
DEPTH_REACH, REFLECTANCE_REACH = 3, 6
"""Distance, in pixels to either side, of the neighbours that a point is compared with, for edges of depth and of
reflectance."""
JUMP_METRES, JUMP_SHARE = 0.5, 0.1
"""A neighbour is on another surface if its depth differs by more than this many metres and by more than this share."""
REFLECTANCE_JUMP = 0.3
"""A point is at an edge of reflectance if more than this share of the scan's points has a reflectance between its own
and that of a darker neighbour."""
FEWEST_POINTS, ENOUGH_POINTS = 30, 100
"""A term with fewer points than the first is left out; with fewer than the second, it weighs proportionally less."""
MOST_POINTS = 2000
"""Largest number of points in a term; more are thinned out evenly."""
BINS = 16
"""Bins of the histograms of reflectance and of brightness."""
INFORMATION_WEIGHT = 10.0
"""Weight of the information distance in the sum; the two kinds of edges, whose values are means, weigh 1."""


class Edges:
    """Points at edges of the scan, attracted by the edges of an image."""

    def __init__(self, edges: Map, points: NDArray[np.float32]) -> None:
        self.edges, self.points = edges, points
        self.weight = min(1.0, len(points) / ENOUGH_POINTS)

    def __call__(self, correction: Transform) -> tuple[float, Vector6]:
        """Minus the mean strength of the edges that the points fall onto, weighted, and its gradient ``[6]``."""
        sampled = self.edges.under(self.points, correction)
        gradient = sampled.gradient(-self.weight / len(self.points), correction[:3, 3])
        return -self.weight * float(sampled.values.mean()), gradient


class Reflectance:
    """Reflectance of points and brightness of the image: how little each says about the other."""

    def __init__(self, brightness: Map, points: NDArray[np.float32], reflectance: Floats) -> None:
        """Brightness and ``reflectance [N]`` of ``points [N, 3]``, both spread about evenly over 0..1."""
        self.brightness, self.points = brightness, points
        self.row, self.into_row = bins(reflectance)

    def __call__(self, correction: Transform) -> tuple[float, Vector6]:
        """Normalised information distance of the joint histogram, weighted, and its gradient ``[6]``."""
        sampled, count = self.brightness.under(self.points, correction), len(self.points)
        column, into_column = bins(sampled.values)
        joint = np.zeros(BINS * BINS)
        for right, share in ((0, 1 - into_column), (1, into_column)):
            for down, part in ((0, 1 - self.into_row), (1, self.into_row)):
                joint += np.bincount((column + right) * BINS + self.row + down, share * part, BINS * BINS)
        distance, slope = information_distance(joint.reshape(BINS, BINS) / count)
        steps = slope[1:] - slope[:-1]  # by moving a point's brightness from one bin to the next
        change = steps[column, self.row] * (1 - self.into_row) + steps[column, self.row + 1] * self.into_row
        weights = INFORMATION_WEIGHT * change * (BINS - 1) / count
        return INFORMATION_WEIGHT * distance, sampled.gradient(weights, correction[:3, 3])


def bins(levels: Floats) -> tuple[NDArray[np.int64], Floats]:
    """The lower of the two bins between which each level 0..1 is divided, and the share of the upper one."""
    position = levels.clip(0.0, 1.0) * (BINS - 1)
    lower = np.minimum(position.astype(np.int64), BINS - 2)
    return lower, position - lower


def information_distance(joint: Floats) -> tuple[float, Floats]:
    """``(H(x, y) - I(x; y)) / H(x, y)`` of a joint distribution, 0 (each fixes the other) to 1; and its derivative."""
    log_joint = np.log(np.maximum(joint, 1e-12))
    x, y = joint.sum(1, keepdims=True), joint.sum(0, keepdims=True)
    log_x, log_y = np.log(np.maximum(x, 1e-12)), np.log(np.maximum(y, 1e-12))
    together = -float((joint * log_joint).sum())
    if together < 1e-6:
        return 1.0, np.zeros_like(joint)  # everything in one bin says nothing
    apart = -float((x * log_x).sum() + (y * log_y).sum())
    slope_of_together, slope_of_apart = -(log_joint + 1), -(log_x + log_y + 2)
    return 2 - apart / together, (apart * slope_of_together - together * slope_of_apart) / together**2


Term = Callable[[Transform], tuple[float, Vector6]]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The terms of one frame or several; their sum is smallest where image and scan fit best."""

    terms: tuple[Term, ...]

    def __call__(self, correction: Transform) -> tuple[float, Vector6]:
        """The sum at a correction, 4x4, and its gradient ``[6]`` by a further motion ``(translation m, rotation rad)``.

        The motion is applied after the correction, and rotates about the origin of the corrected LiDAR frame.
        """
        value, gradient = 0.0, np.zeros(6)
        for term in self.terms:
            more, slope = term(correction)
            value, gradient = value + more, gradient + slope
        return value, gradient


@dataclass(frozen=True)
class Share:
    """Evidence multiplied by a share."""

    evidence: Term
    share: float

    def __call__(self, correction: Transform) -> tuple[float, Vector6]:
        """Value and gradient ``[6]`` for a correction, 4x4."""
        value, gradient = self.evidence(correction)
        return self.share * value, self.share * gradient


@dataclass(frozen=True)
class InRig:
    """The evidence of one camera of a rig, or of one face of a wide lens, for corrections of the rig or lens."""

    evidence: Term
    camera_from_rig: Transform

    def __call__(self, correction: Transform) -> tuple[float, Vector6]:
        """Value and gradient ``[6]`` for a correction of the rig's pose, 4x4."""
        rotation = self.camera_from_rig[:3, :3]
        of_camera = self.camera_from_rig @ correction @ invert(self.camera_from_rig)
        value, gradient = self.evidence(of_camera)
        pivot = rotation @ correction[:3, 3] + self.camera_from_rig[:3, 3]  # the origin about which the rig rotates
        torque = gradient[3:] + np.cross(of_camera[:3, 3] - pivot, gradient[:3])
        return value, np.concatenate([rotation.T @ gradient[:3], rotation.T @ torque])


def gather(frame: Frame, camera_from_lidar: Extrinsic) -> Evidence:
    """Find the evidence in a frame; terms with too few points are left out, and reflectance if a scan has none.

    A wide lens is read face by face; its faces together count as one image.

    Args:
        frame: image, scan and camera; its own extrinsic is not used.
        camera_from_lidar: 4x4, which corrections will be relative to.
    """
    if frame.faces:
        turns = [transform(face.face_from_camera, np.zeros(3)) for face in frame.faces]
        seen = zip(frame.faces, turns, strict=True)
        found = [InRig(gather(frame.through(face), turn @ camera_from_lidar), turn) for face, turn in seen]
        return Evidence(tuple(Share(term, 1 / len(found)) for term in found))
    camera = image_camera(frame.camera)
    grey = np.asarray(cv2.cvtColor(resize_image(frame.image, camera), cv2.COLOR_RGB2GRAY), np.uint8)
    across, any_way = image_edges(grey, camera)
    projection = project(frame.points, camera_from_lidar, camera)
    winner = nearest_per_cell(projection, camera)
    rank = ranks(frame.points[projection.index, 3])
    at_depth, at_reflectance = scan_edges(winner, projection.depth, rank)
    terms: list[Term] = []
    for edges, mask in ((across, at_depth), (any_way, at_reflectance)):
        if mask.sum() >= FEWEST_POINTS:
            terms.append(Edges(edges, projection.points[thinned(winner[mask])]))
    some = thinned(winner[winner >= 0])
    if len(some) >= FEWEST_POINTS and np.ptp(rank[some]) > 0:
        brightness = Map(blurred(cv2.equalizeHist(grey) / np.float32(255), BRIGHTNESS_BLUR), camera)
        terms.append(Reflectance(brightness, projection.points[some], rank[some]))
    return Evidence(tuple(terms))


def image_camera(camera: PinholeCamera) -> PinholeCamera:
    """The camera of the resized image."""
    return camera.fitted(HEIGHT, WIDTH, 1)


def image_edges(grey: NDArray[np.uint8], camera: PinholeCamera) -> tuple[Map, Map]:
    """Strength of edges relative to their surroundings, ``[H, W]``: of edges across the rows, and of all edges.

    The rows of a scan run along those of the image, so where depth jumps along a row, an edge should run across it.
    """
    smooth = blurred(grey, BLUR / 2)
    along_x, along_y = (cv2.Sobel(smooth, cv2.CV_32F, dx, dy, scale=1 / 8) for dx, dy in ((1, 0), (0, 1)))
    contrast = np.hypot(along_x, along_y)
    usual = cv2.blur(contrast, (SURROUNDINGS, SURROUNDINGS)) + FAINTEST

    def strength(contrast: NDArray[np.float32]) -> Map:
        return Map(blurred(np.minimum(contrast / usual, SHARPEST), BLUR), camera)

    return strength(np.abs(along_x)), strength(contrast)


def blurred(image: NDArray[np.floating] | NDArray[np.uint8], sigma: float) -> NDArray[np.float32]:
    """The image blurred by a Gaussian of ``sigma`` pixels."""
    return np.asarray(cv2.GaussianBlur(image.astype(np.float32), (0, 0), sigma), np.float32)


def scan_edges(
    winner: NDArray[np.int64], depth: NDArray[np.float32], rank: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Pixels ``[H, W]`` with a point beside which the depth jumps farther, and with one where only reflectance drops.

    Args:
        winner: ``[H, W]``, the point seen at each pixel, or -1.
        depth: ``[M]``, depth of the points, metres.
        rank: ``[M]``, rank of their reflectance, 0..1.
    """
    hit = winner >= 0
    near = np.append(depth, np.float32(0))[winner]
    bright = np.append(rank, 2.0)[winner].astype(np.float32)

    def row(reach: int) -> NDArray[np.uint8]:
        return np.ones((1, 2 * reach + 1), np.uint8)

    jump = np.maximum(JUMP_METRES, JUMP_SHARE * near)
    at_depth = hit & (cv2.dilate(near, row(DEPTH_REACH)) - near > jump)
    around = row(REFLECTANCE_REACH)
    farthest, nearest = cv2.dilate(near, around), cv2.erode(np.where(hit, near, np.float32(np.inf)), around)
    one_surface = (farthest - near < jump) & (near - nearest < jump)
    return at_depth, hit & one_surface & (bright - cv2.erode(bright, around) > REFLECTANCE_JUMP)


def thinned(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """At most `MOST_POINTS` of the rows, evenly from all over the image."""
    return rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_POINTS)).astype(np.int64)]


def ranks(values: NDArray[np.float32]) -> Floats:
    """For each value the share of values that are smaller, as every sensor scales reflectance differently."""
    return np.searchsorted(np.sort(values), values) / max(len(values), 1)
