"""Reads camera images as RGB, and resizes them without aliasing."""

from __future__ import annotations

import io
import logging
import struct
import warnings
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin

from calibnet.datasets.images.development import Development, ImageError, Levels
from calibnet.errors import DatasetError
from calibnet.geometry import PinholeCamera
from calibnet.runtime.reading import MEGABYTE, read_file

logging.getLogger("PIL").addHandler(logging.NullHandler())  # our own sentence reports damaged files
LARGEST_BYTES = 256 * MEGABYTE
"""Largest size of an image file."""
MOST_PIXELS = 100_000_000
"""Largest number of pixels of an image, which takes 300 MB once decoded."""
FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP", "PPM")
DEPTHS = {"1", "L", "LA", "P", "PA", "RGB", "RGBA", "RGBX", "CMYK", "I;16", "I;16B", "I;16L"}
"""Pillow's pixel modes of camera images; others have 32 bits."""
IMAGE_WIDTH, IMAGE_LENGTH, BITS_PER_SAMPLE, SAMPLE_FORMAT = 256, 257, 258, 339
"""Tags of TIFF."""
FLOATS = 3
"""TIFF's sample format of floats."""
MISSING, MISSING_ROWS = 128, 8
"""Grey level that a JPEG decoder puts where data is missing, and the number of such rows at the end that show it."""
_END_OF_FILE = {b"\x89PNG": b"IEND\xaeB`\x82", b"\xff\xd8\xff": b"\xff\xd9"}
"""First bytes of PNG and JPEG files, and the marker at the end of a complete one."""
AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
"""First column and row of each pass of an interlaced PNG, and its steps."""


BY_ITSELF = Development()
"""Conversion of each image by itself, without others of its drive."""


def read_image(
    path: Path, size: tuple[int, int] | None = None, development: Development = BY_ITSELF
) -> NDArray[np.uint8]:
    """Read an image as ``[H, W, 3]`` uint8 RGB; see `decode_image`.

    Args:
        path: the file.
        size: width and height of the calibration, if known.
        development: conversion of the drive's images.

    Raises:
        DatasetError: the file is missing, truncated, not an image, or of another size.
    """
    try:
        return development(read_levels(path, size))
    except ImageError as error:
        raise DatasetError(f"Image {path} {error}.") from None


def read_levels(path: Path, size: tuple[int, int] | None = None) -> Levels:
    """Read an image as stored; see `read_image`."""
    data = read_file(path, "Image", LARGEST_BYTES)
    try:
        return decode_levels(data, size)
    except ImageError as error:
        raise DatasetError(f"Image {path} {error}.") from None


def decode_image(data: bytes, size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """An image as ``[H, W, 3]`` uint8 RGB, converted by itself; see `decode_levels`."""
    return BY_ITSELF(decode_levels(data, size))


def decode_levels(data: bytes, size: tuple[int, int] | None = None) -> Levels:
    """An image ``[H, W, 3]`` RGB at its stored bit depth; grey images get three equal channels.

    An orientation tag is ignored, since a calibration applies to the pixels as stored. The size is checked in the
    header, before any pixel is decoded.

    Args:
        data: content of a PNG, JPEG, BMP, TIFF, WebP or PGM/PPM file.
        size: required width and height.

    Raises:
        ImageError: it is truncated, damaged, not an image, too large, or of another size.
    """
    floats = _size_of_floats(data)
    if floats is not None:
        _check_size(*floats, size)
        return _floats(data)
    damaged, truncated = (f"is {what}; copy or download it again" for what in ("damaged or not an image", "truncated"))
    if any(data.startswith(start) and data.rfind(end) < 0 for start, end in _END_OF_FILE.items()):
        raise ImageError(truncated)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about oddities that can be read
        try:
            image = Image.open(io.BytesIO(data), formats=FORMATS)
        except Image.DecompressionBombError:
            raise ImageError(f"has more than {MOST_PIXELS // 10**6} million pixels; resize it") from None
        except Exception:  # Pillow's parsers raise many kinds of errors
            raise ImageError(damaged) from None
        _check_size(image.width, image.height, size)
        if image.mode not in DEPTHS and not _is_deep(image, data):
            raise ImageError(f"has pixels of an unsupported kind ({image.mode}); store 8 or 16 bits per channel")
        try:
            if image.format == "PNG" and _ends_flat(image) and not _is_whole(data):
                raise ImageError(truncated)  # Pillow fills missing rows with zeros
            eight = np.array(image.convert("RGB"), np.uint8)
        except (MemoryError, ImageError):
            raise
        except Exception as error:
            raise ImageError(truncated if "truncated" in str(error) else damaged) from None
    if image.format in ("JPEG", "MPO") and (eight[-MISSING_ROWS:] == MISSING).all():
        raise ImageError("is truncated (its lower part is missing); copy or download it again")
    return _sixteen(data, damaged) if _is_deep(image, data) else eight


def _check_size(width: int, height: int, size: tuple[int, int] | None) -> None:
    """Check an image's size against the largest possible one and against its calibration's."""
    if width * height > MOST_PIXELS:
        raise ImageError(f"is {width}x{height}, more than {MOST_PIXELS // 10**6} million pixels; resize it")
    if size is not None and (width, height) != size:
        raise ImageError(
            f"is {width}x{height} but its calibration is for {size[0]}x{size[1]}; calibrate at the size of the images, "
            "or "
            "resize them"
        )


def _size_of_floats(data: bytes) -> tuple[int, int] | None:
    """Width and height of a TIFF with float pixels; None for anything else."""
    if data[:4] not in (b"II*\0", b"MM\0*"):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about a damaged header, which is reported when it is decoded
        try:
            tags = TiffImagePlugin.ImageFileDirectory_v2(data[:8])
            file = io.BytesIO(data)
            file.seek(tags.next)
            tags.load(file)
            kinds = tags.get(SAMPLE_FORMAT, (1,))
            is_float = set(kinds if isinstance(kinds, tuple) else (kinds,)) == {FLOATS}
            return (int(tags[IMAGE_WIDTH]), int(tags[IMAGE_LENGTH])) if is_float else None
        except Exception:
            return None


def _floats(data: bytes) -> Levels:
    """A TIFF of floats, with one channel or three, whose size was checked."""
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None or image.dtype.kind != "f" or (image.ndim == 3 and image.shape[2] != 3):
        raise ImageError("is damaged, or has an unsupported number of float channels; store one or three")
    floats = image.astype(np.float32)
    return np.repeat(floats[..., None], 3, axis=2) if floats.ndim == 2 else np.ascontiguousarray(floats[..., ::-1])


def _ends_flat(image: Image.Image) -> bool:
    """Whether all pixels of the last row are equal."""
    last = np.asarray(image)[-1]
    return bool(np.all(last == last[0]))


def _is_whole(png: bytes) -> bool:
    """Whether the deflated data of a PNG is as long as its header says."""
    width, height, depth, kind, interlaced = struct.unpack(">IIBB2xB", png[16:29])
    bits = depth * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[kind]
    passes = ADAM7 if interlaced else ((0, 0, 1, 1),)
    sizes = [(-(-(width - x) // dx), -(-(height - y) // dy)) for x, y, dx, dy in passes]
    promised = sum(rows * (1 + -(-columns * bits // 8)) for columns, rows in sizes if columns > 0 and rows > 0)
    inflate, found, place = zlib.decompressobj(), 0, 8
    while place + 8 <= len(png) and found < promised:
        length = int.from_bytes(png[place : place + 4])
        if png[place + 4 : place + 8] == b"IDAT":
            found += len(inflate.decompress(png[place + 8 : place + 8 + length], promised))
        place += 12 + length
    return bool(found >= promised)


def _is_deep(image: Image.Image, data: bytes) -> bool:
    """Whether channels have 16 bits, of which Pillow would keep eight."""
    if image.format == "TIFF":
        return bool(max(getattr(image, "tag_v2", {}).get(BITS_PER_SAMPLE, (8,))) > 8)
    if image.format == "PPM":
        return image.mode == "I"
    return bool(image.format == "PNG" and data[24] > 8)


def _sixteen(data: bytes, damaged: str) -> Levels:
    """An image of 16 bits per channel, which is known to be complete."""
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), AS_STORED)
    except cv2.error:
        image = None
    if image is None or image.dtype != np.uint16:
        raise ImageError(damaged)
    return cv2.cvtColor(np.asarray(image, np.uint16), cv2.COLOR_BGR2RGB)


def resize_image(image: NDArray[np.uint8], camera: PinholeCamera) -> NDArray[np.uint8]:
    """Resize ``[H, W, 3]`` to the size of ``camera`` by averaging, since fine texture would alias."""
    size = (camera.width, camera.height)
    shrinks = camera.width <= image.shape[1] and camera.height <= image.shape[0]
    resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return resized.astype(np.uint8, copy=False)
