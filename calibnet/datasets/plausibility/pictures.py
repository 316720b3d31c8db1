"""Checks of an image: its bit depth, and whether it is a Bayer mosaic."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.plausibility.implausible import Implausible

DARK, DARKEST = 24, 15
"""A picture that shines no brighter than the first seems to have lost its upper bits; the second is four bits of eight,
which is all that 12 bits leave where the high byte of 16 is read."""
WRAPPED, GREY = 0.01, 0.3
"""Shares of neighbouring pixels half the range apart, and of grey pixels, where upper bits were cut off. Real pictures
have 0.0005 of the former; 10 or 12 bits cut to their lower eight have 0.01 to 0.2, and black and white is not grey."""
SAME_COLOUR = 0.85
"""The difference of neighbouring pixels to that of the next but one: at most 0.61 in pictures of 13 cameras, and 1.02
or more in the mosaics that their sensors would have given."""
ROW_STEP = 8
"""Step between the rows of an image that are examined."""


def bit_depth(image: NDArray[np.uint8]) -> Implausible | None:
    """Whether a picture ``[H, W, 3]`` lost its upper or its lower bits on the way to eight."""
    rows = image[::ROW_STEP, :, 1].astype(np.int16)
    if 0 < rows.max() <= DARK:
        text = (
            f"no pixel is brighter than {rows.max()} of 255; if the camera gives 10 or 12 bits, "
            "shift the picture's values up before they are cut to eight"
        )
        return Implausible("bit-depth", text, certain=bool(rows.max() <= DARKEST))
    jumps = float((np.abs(np.diff(rows, axis=1)) > 128).mean())
    if jumps < WRAPPED or float(((rows > 64) & (rows < 192)).mean()) < GREY:
        return None
    text = (
        "neighbouring pixels jump from black to white as where upper bits were cut off; "
        "if the camera gives 10 or 12 bits, shift the picture's values down before they are cut to eight"
    )
    return Implausible("bit-depth", text)


def mosaic(image: NDArray[np.uint8]) -> Implausible | None:
    """Whether a grey picture ``[H, W, 3]`` is that of a Bayer sensor, before its colours were made.

    The next pixel but one has the same colour there, and is more alike than the next one; never so in other pictures.
    """
    if not (image[::ROW_STEP, :, 0] == image[::ROW_STEP, :, 2]).all():
        return None
    green = image[..., 1].astype(np.int16)
    for rows in (green[::ROW_STEP], green[:, ::ROW_STEP].T):
        next_one, next_but_one = (np.abs(rows[:, step:] - rows[:, :-step]).mean() for step in (1, 2))
        if not next_one > SAME_COLOUR * next_but_one > 0:
            return None
    text = (
        "the picture seems to be raw, of a sensor with a Bayer pattern; name that in calibration.yaml, for instance "
        "'bayer: rggb'"
    )
    return Implausible("bayer", text)
