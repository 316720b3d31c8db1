"""Matches made by hand: a scan whose points are found where a true pose and a true lens show them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import RANGES, PinholeCamera, transform_points
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.judging.lens_causes import FAULTS, LensOdds
from calibnet.trace import CascadeTrace, Matches, StageTrace

CAMERA = PinholeCamera(1024, 320, np.array([[580.0, 0, 511.5], [0, 580.0, 159.5], [0, 0, 1]]))
"""Of the stage that looked."""
GAINS = {"focal-length": "fine_focal_gain", "principal-point": "fine_center_gain", "distortion": "fine_radial_gain"}
LENS_ODDS = LensOdds(0.6, dict.fromkeys(FAULTS, -2.0), {name: {gain: 20.0} for name, gain in GAINS.items()})
"""Each fault by what its own lens saves of the finest look's cost."""


def scene(count: int = 1500) -> NDArray[np.float32]:
    """Points ``[N, 3]`` of the camera frame: a road below, houses at both sides."""
    generator = np.random.default_rng(3)
    depth = 1 / generator.uniform(1 / 60, 1 / 5, count)
    u, v = generator.uniform(-0.85, 0.85, count), generator.uniform(-0.1, 0.27, count)
    depth = np.where(v > 0.05, 1.6 / v, depth)
    return np.column_stack([u * depth, v * depth, depth]).astype(np.float32)


def matches(
    correction: Transform,
    bend: Callable[[Floats], Floats] = lambda places: places,
    noise: float = 0.0,
    camera: PinholeCamera = CAMERA,
) -> Matches:
    """Matches of a look whose scan has to be corrected, as a lens shows them.

    Args:
        correction: that is needed, 4x4.
        bend: where the true lens shows what lies at ``places [N, 2]`` (x/z, y/z), in focal lengths that are believed.
        noise: in pixels, along both axes.
        camera: of the stage.
    """
    points = scene()
    moved = transform_points(correction, points.astype(np.float64))
    seen, was = bend(moved[:, :2] / moved[:, 2:]), points[:, :2] / points[:, 2:]
    displacement = (seen - was) * np.array(camera.focal)
    displacement = displacement + np.random.default_rng(4).normal(0.0, noise, displacement.shape)
    scale = np.full((len(points), 2), max(noise, 0.5))
    return Matches(points, displacement.astype(np.float32), scale.astype(np.float32))


def run(
    initial: Extrinsic, after: Extrinsic, found: Matches | None = None, match_error: float = 1.5, limit: float = 5.5
) -> CascadeTrace:
    """A run of stages 3 to 5 of which stage 4 has done it all."""
    stages = []
    for number, (before, then) in enumerate(((initial, initial), (initial, after), (after, after)), start=3):
        correction = then @ np.linalg.inv(before)
        information = np.diag([4e4, 4e4, 1e4, 4e6, 4e6, 4e6])
        stages.append(
            StageTrace(
                number, RANGES[number - 1], CAMERA, before, then, correction,
                information=information, match_error_px=match_error, matches=found,
            )
        )  # fmt: skip
    return CascadeTrace(initial, tuple(stages), match_error_limit_px=limit)
