"""A fisheye that sees 183 degrees, and a scan all around it whose points are dots in its image."""

from __future__ import annotations

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.datasets.images.lens import Lens
from calibnet.geometry import CameraModel, invert, rotation_from_vector, transform
from calibnet.geometry.se3 import transform_points
from calibnet.geometry.types import Transform
from tests.support.scene import REFERENCE

FOCAL = 120.0
CAMERA = CameraModel(
    384, 240, np.array([[FOCAL, 0.0, 191.5], [0.0, FOCAL, 119.5], [0.0, 0.0, 1.0]]), "equidistant", np.zeros(4)
)
MOUNT = transform(rotation_from_vector([-0.3, 0.0, 0.0]), np.zeros(3)) @ REFERENCE
"""Tilted towards the ground, by 17 degrees."""


def turned(degrees: float) -> Transform:
    """The camera at a roll, from the camera."""
    return transform(rotation_from_vector([0.0, 0.0, np.radians(degrees)]), np.zeros(3))


def make_wide(on_its_head: bool = False, seed: int = 0) -> Frame:
    """A frame; on its head its image is turned by 180 degrees, and nothing else is another."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(6000, 3)) * [1.0, 0.25, 1.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    in_camera = directions * generator.uniform(4.0, 30.0, (6000, 1))
    seen = CAMERA.see(in_camera)
    u, v = np.round(seen.pixels).astype(int).T
    shown = seen.valid & (u >= 0) & (u < 384) & (v >= 0) & (v < 240)
    image = generator.integers(60, 90, (240, 384, 3)).astype(np.uint8)
    image[v[shown], u[shown]] = generator.integers(100, 256, (int(shown.sum()), 3))
    points = transform_points(invert(MOUNT), in_camera)
    scan = np.column_stack([points, generator.uniform(size=6000)]).astype(np.float32)
    mount = MOUNT
    if on_its_head:
        mount, image = turned(180.0) @ MOUNT, np.ascontiguousarray(image[::-1, ::-1])
    lens = Lens.of(CAMERA, mount, [image])
    picture = lens(image)
    return Frame(0, 0.0, picture.image, scan, lens.pinhole, mount, "wide", (), picture.original, picture.faces)
