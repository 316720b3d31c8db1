"""Masks of the image: of Segment Anything, read from PNG files, or of a classical segmentation."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import read_image, resize_image
from calibnet.errors import ConfigError
from calibnet.geometry import PinholeCamera

SCALE, SMALLEST, BLUR = 150.0, 120, 0.8
"""Parameters of the segmentation: scale (larger for larger regions), fewest pixels of a region, and blur."""
MOST_MASKS = 2000
"""Largest number of files read for an image."""
LARGEST_SHARE = 0.5
"""Largest share of the image that a mask may cover; a larger one is the sky, or everything."""
NONE = -1

Labels = NDArray[np.int64]
"""``[H, W]``, the mask that each pixel belongs to, or `NONE`."""


def segmented(frame: Frame, camera: PinholeCamera) -> Labels:
    """Regions of similar colours, by the graph segmentation of Felzenszwalb & Huttenlocher (2004)."""
    from skimage.segmentation import felzenszwalb

    image = resize_image(frame.image, camera)
    return np.asarray(felzenszwalb(image, scale=SCALE, sigma=BLUR, min_size=SMALLEST), np.int64)


def read_masks(folder: Path, frame: Frame, camera: PinholeCamera) -> Labels:
    """Read the masks of a frame: PNG files, white inside the mask, in the folder named after its image.

    Masks may overlap. A pixel belongs to the smallest mask that contains it, which is the most specific.

    Raises:
        ConfigError: there are no masks, or one differs from the image in size.
    """
    where = folder / Path(frame.source).stem
    files = sorted(where.glob("*.png"))[:MOST_MASKS] if where.is_dir() else []
    if not files:
        raise ConfigError(
            f"{where} has no masks; --masks DIR needs a folder for each image, named like it without suffix, "
            "with one PNG per mask, as written by Segment Anything's amg.py."
        )
    masks = [_read_mask(file, frame) for file in files]
    labels = np.full((camera.height, camera.width), NONE, np.int64)
    for number, mask in enumerate(sorted(masks, key=np.count_nonzero, reverse=True)):
        if mask.mean() <= LARGEST_SHARE:
            small = cv2.resize(mask.astype(np.uint8), (camera.width, camera.height), interpolation=cv2.INTER_NEAREST)
            labels[small > 0] = number
    return labels


def _read_mask(file: Path, frame: Frame) -> NDArray[np.bool_]:
    pixels = read_image(file)
    size = (frame.camera.height, frame.camera.width)
    if pixels.shape[:2] != size:
        raise ConfigError(
            f"The mask {file} has {pixels.shape[1]} x {pixels.shape[0]} pixels but its image {size[1]} x {size[0]}; "
            "make masks from the same images that are calibrated."
        )
    return np.asarray(pixels.max(axis=2) > 127)


def painted(labels: Labels) -> NDArray[np.uint8]:
    """The masks in different colours, ``[H, W, 3]``; black outside all masks."""
    palette = np.random.default_rng(0).integers(60, 256, (max(int(labels.max()) + 1, 1), 3), dtype=np.uint8)
    return np.where((labels >= 0)[..., None], palette[np.maximum(labels, 0)], np.uint8(0))
