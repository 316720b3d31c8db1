"""Camera images: read whole, as stored, RGB; resized without aliasing."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.errors import DatasetError
from calibnet.geometry import PinholeCamera

_END_OF_FILE = {b"\x89PNG": b"IEND\xaeB`\x82", b"\xff\xd8\xff": b"\xff\xd9"}
"""First bytes of a PNG or JPEG file to the marker that ends a whole one."""

AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


def read_image(path: Path) -> NDArray[np.uint8]:
    """Read an image as ``[H, W, 3]`` uint8 RGB; grey images get three equal channels, 16 bits become `eight_bits`.

    An orientation tag is ignored: a calibration is of the pixels as they are stored.

    Raises:
        DatasetError: the file is missing, truncated or no image.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(f"Image {path} cannot be read ({error.strerror}); restore it.") from None
    for start, end in _END_OF_FILE.items():
        # Checked before decoding: what a decoder makes of half a file depends on its version.
        if data.startswith(start) and data.rfind(end) < 0:
            raise DatasetError(f"Image {path} is truncated; copy or download it again.")
    image = None
    if data:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), AS_STORED)
    if image is None:
        raise DatasetError(f"Image {path} is damaged or not an image; copy or download it again.")
    if image.dtype == np.uint16:
        image = eight_bits(np.asarray(image, np.uint16))
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)


def eight_bits(image: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """The upper eight of the bits that a picture uses: cameras give 10 or 12 of them, and files 16 to hold them."""
    used = next(bits for bits in (8, 10, 12, 14, 16) if image.max() < 1 << bits)
    return (image >> (used - 8)).astype(np.uint8)


def resize_image(image: NDArray[np.uint8], camera: PinholeCamera) -> NDArray[np.uint8]:
    """Resize ``[H, W, 3]`` to the size of ``camera``; averaging, as fine texture would alias."""
    size = (camera.width, camera.height)
    shrinks = camera.width <= image.shape[1] and camera.height <= image.shape[0]
    resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return resized.astype(np.uint8, copy=False)
