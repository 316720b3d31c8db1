"""Faults of the image."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.evaluation.faults.alteration import NATIVE_WIDTH, Alteration
from calibnet.geometry import rotation_from_euler_xyz, transform


def grey(frame: Frame) -> Frame:
    """The frame with a uniformly grey image."""
    return replace(frame, image=np.full_like(frame.image, 128))


def image_of(donor: Frame) -> Alteration:
    """The image of another frame, resized to fit."""
    return lambda frame: replace(frame, image=resize_image(donor.image, frame.camera))


def blurred(pixels: float) -> Alteration:
    """Blur the image by a Gaussian with a standard deviation in native pixels."""

    def alter(frame: Frame) -> Frame:
        sigma = pixels * frame.camera.width / NATIVE_WIDTH
        return replace(frame, image=np.asarray(cv2.GaussianBlur(frame.image, (0, 0), sigma), np.uint8))

    return alter


def exposed(gain: float) -> Alteration:
    """Multiply the exposure of the image by ``gain``; values beyond white are clipped."""
    return lambda frame: replace(frame, image=np.minimum(frame.image * np.float32(gain), 255).astype(np.uint8))


def mirrored(frame: Frame) -> Frame:
    """Mirror the image, left to right."""
    return replace(frame, image=np.ascontiguousarray(frame.image[:, ::-1]))


def rolled(degrees: float) -> Alteration:
    """Rotate the image clockwise about the principal point, and the true extrinsic with it."""

    def alter(frame: Frame) -> Frame:
        turn = rotation_from_euler_xyz([0.0, 0.0, np.radians(degrees)])
        matrix, size = frame.camera.matrix, (frame.camera.width, frame.camera.height)
        image = cv2.warpPerspective(frame.image, matrix @ turn @ np.linalg.inv(matrix), size, flags=cv2.INTER_LINEAR)
        truth = transform(turn, np.zeros(3)) @ frame.camera_from_lidar
        return replace(frame, image=image.astype(np.uint8, copy=False), camera_from_lidar=truth)

    return alter


def shifted(right: float, down: float) -> Alteration:
    """Shift the image by this many native pixels."""

    def alter(frame: Frame) -> Frame:
        size, scale = (frame.camera.width, frame.camera.height), frame.camera.width / NATIVE_WIDTH
        motion = np.array([[1.0, 0.0, right * scale], [0.0, 1.0, down * scale]])
        return replace(frame, image=cv2.warpAffine(frame.image, motion, size).astype(np.uint8, copy=False))

    return alter


def high_byte(bits: int) -> Alteration:
    """The high byte of an image of this many bits stored in 16, which is almost black."""
    return lambda frame: replace(frame, image=frame.image >> np.uint8(16 - bits))


def low_byte(bits: int) -> Alteration:
    """The low byte of an image of this many bits, in which brightness wraps around."""

    def alter(frame: Frame) -> Frame:
        steps = 1 << (bits - 8)
        fraction = np.random.default_rng(frame.index).integers(0, steps, frame.image.shape)
        return replace(frame, image=((frame.image.astype(np.int64) * steps + fraction) & 255).astype(np.uint8))

    return alter
