"""Whether an image can be what it is taken to be; see `calibnet.datasets.plausibility`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.plausibility import Implausible

DARK, DARKEST = 24, 15
"""Largest brightness of an image that seems to have lost its upper bits, and of one that certainly has: four bits of
eight are left of 12 bits if the high byte of 16 is read."""
WRAPPED, GREY = 0.01, 0.3
"""Smallest shares of neighbouring pixels that differ by half the range, and of grey pixels, in an image whose upper
bits were cut off. Real images have 0.0005 of the former; 10 or 12 bits cut to their lower eight have 0.01 to 0.2, and
images of black and white are not grey."""
SAME_COLOUR = 0.85
"""Ratio of the difference between neighbouring pixels to that of the next but one: at most 0.61 in images of 13
cameras, and at least 1.02 in Bayer mosaics made from them."""
ROW_STEP = 8
"""Rows of an image from one to the next that are looked at."""


def bit_depth(image: NDArray[np.uint8]) -> Implausible | None:
    """Check that an image ``[H, W, 3]`` did not lose its upper or lower bits in the conversion to eight."""
    rows = image[::ROW_STEP, :, 1].astype(np.int16)
    if 0 < rows.max() <= DARK:
        text = (
            f"no pixel is brighter than {rows.max()} of 255; if the camera gives 10 or 12 bits, "
            "shift the image's values up before they are cut to eight"
        )
        return Implausible("bit-depth", text, certain=bool(rows.max() <= DARKEST))
    jumps = float((np.abs(np.diff(rows, axis=1)) > 128).mean())
    if jumps < WRAPPED or float(((rows > 64) & (rows < 192)).mean()) < GREY:
        return None
    text = (
        "neighbouring pixels jump from black to white as where upper bits were cut off; "
        "if the camera gives 10 or 12 bits, shift the image's values down before they are cut to eight"
    )
    return Implausible("bit-depth", text)


def mosaic(image: NDArray[np.uint8]) -> Implausible | None:
    """Check that a grey image ``[H, W, 3]`` is not the raw mosaic of a Bayer sensor.

    In a mosaic the next pixel but one has the same colour, and is more similar than the next one; in other images it
    never is.
    """
    if not (image[::ROW_STEP, :, 0] == image[::ROW_STEP, :, 2]).all():
        return None
    green = image[..., 1].astype(np.int16)
    for rows in (green[::ROW_STEP], green[:, ::ROW_STEP].T):
        next_one, next_but_one = (np.abs(rows[:, step:] - rows[:, :-step]).mean() for step in (1, 2))
        if not next_one > SAME_COLOUR * next_but_one > 0:
            return None
    text = (
        "the image seems to be raw, of a sensor with a Bayer pattern; name that in calibration.yaml, for instance "
        "'bayer: rggb'"
    )
    return Implausible("bayer", text)
