"""Converts images as stored to eight bits per channel, in the same way for all images of a drive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

BAYER = {
    "rggb": cv2.COLOR_BayerRGGB2RGB,
    "bggr": cv2.COLOR_BayerBGGR2RGB,
    "gbrg": cv2.COLOR_BayerGBRG2RGB,
    "grbg": cv2.COLOR_BayerGRBG2RGB,
}
"""OpenCV's conversion of each Bayer pattern, named by the first two pixels of the first two rows."""
BITS = (8, 10, 12, 14, 16)
"""Bit depths of cameras, stored in 8 or 16 bits."""
BRIGHT = 99.5
"""Percentile of a float image's levels that becomes white if they have no usual scale."""

Levels = NDArray[Any]
"""An image ``[H, W, 3]`` RGB as stored: uint8, uint16 or float32; the channels of a grey image are equal."""


class ImageError(ValueError):
    """An error in an image, in words that continue a sentence."""


@dataclass(frozen=True)
class Development:
    """Conversion of stored levels to eight bits.

    Attributes:
        white: level that becomes 255, for images of more than 8 bits; None to find it for each image.
        bayer: pattern of a sensor whose images are not demosaiced, one of `BAYER`; None for others.
    """

    white: float | None = None
    bayer: str | None = None

    @classmethod
    def of(cls, images: Iterable[Levels], bayer: str | None = None) -> Development:
        """The conversion for a drive, from some of its images."""
        deep = [image for image in images if image.dtype != np.uint8]
        return cls(white_of(deep) if deep else None, bayer)

    def __call__(self, levels: Levels) -> NDArray[np.uint8]:
        """The image ``[H, W, 3]`` RGB in eight bits.

        Raises:
            ImageError: it is to be demosaiced but has colours.
        """
        white = 256.0
        if levels.dtype != np.uint8:
            white = white_of([levels]) if self.white is None else self.white
        if levels.dtype == np.float32:
            levels = (np.clip(np.nan_to_num(levels) / white, 0.0, 1.0) * 65_535).astype(np.uint16)
            white = 65_536.0
        if self.bayer is not None:
            if not (levels == levels[..., :1]).all():
                raise ImageError("has colours, although its calibration has 'bayer'; remove that")
            levels = np.asarray(cv2.cvtColor(np.ascontiguousarray(levels[..., 0]), BAYER[self.bayer]))
        if levels.dtype == np.uint8:
            return levels.astype(np.uint8, copy=False)
        return np.minimum(levels.astype(np.uint32) * 256 // int(white), 255).astype(np.uint8)


def white_of(images: list[Levels]) -> float:
    """The level of white in images of more than 8 bits: the largest value of the camera's bit depth.

    For floats, 1, 255 or that of a bit depth if all are within; else the level of all but the brightest.
    """
    if all(image.dtype != np.float32 for image in images):
        deepest = max(int(image.max(initial=0)) for image in images)
        return float(next(1 << bits for bits in BITS if deepest < 1 << bits))
    levels = np.concatenate([np.nan_to_num(image[::4, ::4]).ravel() for image in images])
    brightest = float(levels.max(initial=0.0))
    for scale in (1.0, 255.0, *(float((1 << bits) - 1) for bits in BITS[1:])):
        if brightest <= scale:
            return scale
    return max(float(np.percentile(levels, BRIGHT)), 1.0)
