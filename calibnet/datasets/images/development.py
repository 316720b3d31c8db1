"""From what a camera stores to eight bits a channel: the same for all pictures of a drive, as its exposure is seen."""

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
"""Colours of the first two pixels of the first two rows of a sensor, by name."""
BITS = (8, 10, 12, 14, 16)
"""That cameras give; a file has 16 to hold them."""
BRIGHT = 99.5
"""Percentile of a float picture's levels that counts as white where these have no usual scale."""

Levels = NDArray[Any]
"""A picture ``[H, W, 3]`` RGB as it is stored: uint8, uint16 or float32; the three are alike where it has no colour."""


class ImageError(ValueError):
    """What is wrong with a picture, in words that continue a sentence."""


@dataclass(frozen=True)
class Development:
    """How stored levels become eight bits.

    Attributes:
        white: level that becomes 255, of pictures of more than 8 bits; None to tell it of each picture by itself.
        bayer: name of the pattern of a sensor whose pictures are not demosaiced, one of `BAYER`; None for others.
    """

    white: float | None = None
    bayer: str | None = None

    @classmethod
    def of(cls, pictures: Iterable[Levels], bayer: str | None = None) -> Development:
        """That of a drive, by some of its pictures."""
        deep = [picture for picture in pictures if picture.dtype != np.uint8]
        return cls(white_of(deep) if deep else None, bayer)

    def __call__(self, levels: Levels) -> NDArray[np.uint8]:
        """The picture ``[H, W, 3]`` RGB.

        Raises:
            ImageError: it is to be demosaiced and has colours.
        """
        white = 256.0
        if levels.dtype != np.uint8:
            white = white_of([levels]) if self.white is None else self.white
        if levels.dtype == np.float32:
            levels = (np.clip(np.nan_to_num(levels) / white, 0.0, 1.0) * 65_535).astype(np.uint16)
            white = 65_536.0
        if self.bayer is not None:
            if not (levels == levels[..., :1]).all():
                raise ImageError("has colours, though its calibration says 'bayer'; leave that out there")
            levels = np.asarray(cv2.cvtColor(np.ascontiguousarray(levels[..., 0]), BAYER[self.bayer]))
        if levels.dtype == np.uint8:
            return levels.astype(np.uint8, copy=False)
        return np.minimum(levels.astype(np.uint32) * 256 // int(white), 255).astype(np.uint8)


def white_of(pictures: list[Levels]) -> float:
    """The level of white in pictures of more than 8 bits: the end of the depth that the camera uses.

    Of floats 1, 255 or a depth if all lie within; else what all but the brightest stay below.
    """
    if all(picture.dtype != np.float32 for picture in pictures):
        deepest = max(int(picture.max(initial=0)) for picture in pictures)
        return float(next(1 << bits for bits in BITS if deepest < 1 << bits))
    levels = np.concatenate([np.nan_to_num(picture[::4, ::4]).ravel() for picture in pictures])
    brightest = float(levels.max(initial=0.0))
    for scale in (1.0, 255.0, *(float((1 << bits) - 1) for bits in BITS[1:])):
        if brightest <= scale:
            return scale
    return max(float(np.percentile(levels, BRIGHT)), 1.0)
