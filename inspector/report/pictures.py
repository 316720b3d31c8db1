"""The report's pictures: recorded LiDAR points over the recorded image."""

from __future__ import annotations

from html import escape

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.images.development import ImageError
from calibnet.datasets.images.files import decode_image
from calibnet.errors import CalibnetError
from inspector.colors import FAR_M, LABELLED_DEPTHS_M, NEAR_M, depth_colors

PICTURE_WIDTH = 1600
"""Width of all pictures in pixels, so that points look alike for all cameras."""
POINT_RADIUS = (2.2, 3.2)
"""Smallest and largest radius in pixels; fewer points are drawn larger, so that they show in a small picture."""
POINT_SHARE = 0.2
"""Radius relative to the distance between points."""
DIMMED = 0.75
"""Brightness of the image, dimmed so that points stand out from a bright road."""
JPEG_QUALITY = 86
FARTHEST_PX = 1e5
"""Largest coordinate of points to draw; others are far outside the image."""
TALLEST = 8
"""Largest height of an image, relative to its width."""
SHIFT = 4
"""Fractional bits of the positions at which cv2 draws."""


class PictureError(CalibnetError):
    """A picture of the recording cannot be decoded."""


def draw_overlay(
    image_jpeg: bytes, pixels: NDArray[np.floating], colors: NDArray[np.uint8], size: tuple[int, int] | None = None
) -> bytes:
    """Draw points over an image; returns a JPEG `PICTURE_WIDTH` wide.

    Args:
        image_jpeg: the image as recorded.
        pixels: ``[M, 2]``, ``(u, v)`` with whole numbers at pixel centres, far to near.
        colors: ``[M, 3]`` RGB.
        size: width and height that the image must have.

    Raises:
        PictureError: the image cannot be decoded, or is of another size.
    """
    try:
        image = cv2.cvtColor(decode_image(image_jpeg, size), cv2.COLOR_RGB2BGR)
    except ImageError as error:
        what = str(error).partition(";")[0]
        raise PictureError(f"An image in the recording {what}; record the run again.") from None
    if image.shape[0] > TALLEST * image.shape[1]:
        raise PictureError("An image in the recording is far too narrow; record the run again.")
    scale = PICTURE_WIDTH / image.shape[1]
    size = (PICTURE_WIDTH, round(image.shape[0] * scale))
    near = (np.abs(pixels) < FARTHEST_PX).all(axis=1)  # false for NaN
    pixels, colors = pixels[near], colors[near]
    canvas = cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC)
    canvas = cv2.convertScaleAbs(canvas, alpha=DIMMED)
    one = 1 << SHIFT
    centers = np.rint(((pixels + 0.5) * scale - 0.5) * one).astype(int)
    spacing = np.sqrt(size[0] * size[1] / max(len(pixels), 1))
    radius = round(float(np.clip(POINT_SHARE * spacing, *POINT_RADIUS)) * one)
    for center, color in zip(centers.tolist(), colors[:, 2::-1].tolist(), strict=True):
        cv2.circle(canvas, center, radius, color, cv2.FILLED, cv2.LINE_AA, SHIFT)
    encoded = cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return encoded.tobytes()


def depth_scale() -> str:
    """The colour scale of depth as an inline SVG, with depths in metres below."""
    width, height, steps = 320, 12, 64
    span = np.log(FAR_M / NEAR_M)
    depths = (NEAR_M * np.exp(span * (np.arange(steps) + 0.5) / steps)).astype(np.float32)
    parts = [
        f'<rect x="{index * width / steps:.2f}" width="{width / steps + 0.3:.2f}" height="{height}" '
        f'fill="rgb({red},{green},{blue})"/>'
        for index, (red, green, blue) in enumerate(depth_colors(depths).tolist())
    ]
    for metres in LABELLED_DEPTHS_M:
        x = width * float(np.log(metres / NEAR_M) / span)
        anchor = {NEAR_M: "start", FAR_M: "end"}.get(metres, "middle")
        label = escape(f"{metres} m" if metres == FAR_M else f"{metres}")
        parts.append(f'<text class="number" x="{x:.1f}" y="{height + 14}" text-anchor="{anchor}">{label}</text>')
    name = f"Colours of depth, red at {NEAR_M:g} metres to blue at {FAR_M:g}"
    return (
        f'<svg class="scale" viewBox="0 0 {width} {height + 18}" role="img" aria-label="{name}">{"".join(parts)}</svg>'
    )
