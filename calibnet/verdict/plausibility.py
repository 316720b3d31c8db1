"""What of a frame cannot be right whatever its extrinsic is: checks that cost next to nothing, before anything else.

Limits lie well beyond all sensors that were looked at (docs of the battery): they name what is wrong, and never doubt
what is merely unusual.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.verdict.verdict import Cause

NARROWEST_DEG, WIDEST_DEG = 8.0, 150.0
"""Angles of view across that a rectified picture has."""
SIZE_RATIO = 0.12
"""Twice the principal point by the picture's size is 1; both directions off by the same factor, farther from 1 than
this (as a logarithm), are the sign of another size's matrix."""
SAME_RATIO = 0.2
"""How far the two directions may differ for that, likewise."""
FARTHEST_CENTRE = 0.45
"""How far from the middle the principal point may lie, as a share of the picture's half width or height."""
NEAREST_MEDIAN, FARTHEST_MEDIAN, MILLIMETRES = 0.3, 200.0, 1200.0
"""Median ranges in metres that no scanner sees, too near and too far, and beyond which it must be millimetres."""
ROWS = 8
"""Of so many rows of a picture one is looked at."""
DARKEST = 20
"""Grey level that the brightest thousandth reaches in the darkest picture of eight bits."""
WRAPPED, MOST_WHITE = 0.05, 0.3
"""Share of neighbouring pixels that differ by more than half the grey levels, beyond which brightness wraps round; and
share of white ones, beyond which the picture is over-exposed instead."""
FLATTEST, FLATTEST_IN_THE_DARK = 2.0, 0.5
"""Standard deviation of grey levels under which nothing can be seen, and that of a picture that is almost black."""
GROUND_SHARE, GROUND_FACTOR = 0.15, 2.0
"""Share of a scan that lies in a slab across an axis, and how many times that below, for the ground to lie there."""
SLAB = np.arange(0.2, 4.01, 0.3)
"""Metres from the scanner: borders of the slabs in which the ground is looked for."""


def implausible(frame: Frame) -> tuple[Cause, ...]:
    """What of the frame cannot be right."""
    checks: tuple[Callable[[Frame], Iterator[Cause]], ...] = (_picture, _camera, _unit, _ground)
    return tuple(cause for check in checks for cause in check(frame))


def is_blank(frame: Frame) -> bool:
    """Whether the picture shows nothing at all."""
    return float(frame.image[::ROWS].std()) < (FLATTEST_IN_THE_DARK if _brightest(frame) <= DARKEST else FLATTEST)


def _brightest(frame: Frame) -> float:
    return float(np.percentile(frame.image[::ROWS], 99.9))


def _picture(frame: Frame) -> Iterator[Cause]:
    green = frame.image[::ROWS, :, 1].astype(np.int16)
    brightest = _brightest(frame)
    if not is_blank(frame) and brightest <= DARKEST:
        yield Cause(
            "bit-depth",
            "The picture is almost black: it seems to hold more than 8 bits, of which only the highest were read; "
            "scale it to 0..255.",
            f"the brightest thousandth of its values is {brightest:.0f} of 255",
        )
    wrapped = float(np.mean(np.abs(np.diff(green, axis=1)) > 128))
    if wrapped > WRAPPED and np.mean(green >= 250) < MOST_WHITE:
        yield Cause(
            "bit-depth",
            "The picture's brightness wraps round: it seems to hold more than 8 bits, of which only the lowest were "
            "read; scale it to 0..255.",
            f"{100 * wrapped:.0f} % of neighbouring pixels differ by more than 128 grey levels",
        )


def _camera(frame: Frame) -> Iterator[Cause]:
    camera = frame.camera
    across = 2 * camera.center[0] / max(camera.width - 1, 1)
    down = 2 * camera.center[1] / max(camera.height - 1, 1)
    logarithms = np.log(np.maximum([across, down], 1e-3))
    view = float(np.degrees(2 * np.arctan(0.5 * camera.width / camera.focal[0])))
    said = f"principal point {camera.center[0]:.0f}, {camera.center[1]:.0f} of {camera.width}x{camera.height} pixels"
    if abs(logarithms.mean()) > SIZE_RATIO and np.ptp(logarithms) < SAME_RATIO and abs(logarithms).min() > SIZE_RATIO:
        factor = float(np.exp(logarithms.mean()))
        yield Cause(
            "picture-size",
            f"camera_matrix seems to be that of a picture of about {factor * camera.width:.0f}x"
            f"{factor * camera.height:.0f} pixels, and the pictures have {camera.width}x{camera.height}; scale it.",
            said,
        )
    elif max(abs(across - 1), abs(down - 1)) > FARTHEST_CENTRE:
        yield Cause("principal-point", "The principal point lies far from the middle of the picture.", said)
    elif not NARROWEST_DEG <= view <= WIDEST_DEG:
        yield Cause(
            "focal-length",
            f"With the focal length of camera_matrix the picture would be {view:.0f} degrees wide.",
            f"focal length {camera.focal[0]:.0f} px of a picture {camera.width} px wide",
        )


def _unit(frame: Frame) -> Iterator[Cause]:
    distance = np.linalg.norm(frame.points[:, :3], axis=1)
    distance = distance[distance > 0]
    median = float(np.median(distance)) if len(distance) else 1.0
    if not NEAREST_MEDIAN <= median <= FARTHEST_MEDIAN:
        unit = "kilometres" if median < NEAREST_MEDIAN else "millimetres" if median > MILLIMETRES else "centimetres"
        yield Cause(
            "units",
            f"The scan seems to be in {unit}; give it in metres.",
            f"half of its points would be {'nearer' if median < NEAREST_MEDIAN else 'farther'} than {median:.3g} m",
        )


def _ground(frame: Frame) -> Iterator[Cause]:
    """The ground is the largest plane across an axis near most scanners; it has to lie below."""
    points = frame.points[np.linalg.norm(frame.points[:, :3], axis=1) > 3.0, :3]
    if len(points) < 100:
        return
    shares = {}
    for axis, name in enumerate("xyz"):
        for sign in (-1, 1):
            shares[f"{'+' if sign > 0 else '-'}{name}"] = float(
                np.histogram(sign * points[:, axis], SLAB)[0].max() / len(points)
            )
    below = shares.pop("-z")
    elsewhere = max(shares, key=lambda side: shares[side])
    if shares[elsewhere] > max(GROUND_SHARE, GROUND_FACTOR * below):
        said = f"{100 * shares[elsewhere]:.0f} % of its points lie in one plane there, {100 * below:.0f} % below"
        text = f"The scan's ground seems to lie towards {elsewhere}: its axes are not x forward, y left, z up."
        yield Cause("axes", text, said)
        if elsewhere == "+z":  # turned over, or only this axis the other way round: the ground is the same
            yield Cause("left-handed", "If only z points down, the scan's axes are left-handed as well.", said)
