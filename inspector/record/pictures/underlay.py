"""The image under the maps, small, grey and dim, which shows what each cell covers."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import rerun as rr

from calibnet.trace import StageTrace
from inspector import entities
from inspector.record.contents import Contents
from inspector.record.observation import Observation
from inspector.record.subtree import Subtree

WIDTH = 288
"""Largest width in pixels; a page shows it a third of a screen wide."""
BRIGHTNESS = 0.75
JPEG_QUALITY = 55
BEHIND = -30.0
"""Draw order; other images have -10."""


def log_underlays(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the image that each stage saw, once for every scale whose maps are shown, in units of its cells."""
    for stage in observation.trace.stages:
        for scale in contents.scales(stage.detail):
            jpeg, width, height = _seen_by(observation, stage)
            cells = stage.camera.width / scale.stride, stage.camera.height / scale.stride
            rec.log(
                entities.of_scale(stage.number, scale.stride, entities.PICTURE),
                rr.Transform3D(scale=[cells[0] / width, cells[1] / height, 1.0]),
                rr.EncodedImage(contents=jpeg, media_type="image/jpeg", draw_order=BEHIND, opacity=1.0),
            )


def _seen_by(observation: Observation, stage: StageTrace) -> tuple[bytes, int, int]:
    """JPEG, width and height of the image that a stage saw, whose size and rotation depend on the stage."""
    upright = None if stage.upright is None else stage.upright.tobytes()
    size = (stage.camera.width, stage.camera.height) if upright else (0, 0)
    return _encoded(observation, upright, size, stage.camera.matrix.tobytes() if upright else b"")


@lru_cache(maxsize=8)
def _encoded(
    observation: Observation, upright: bytes | None, size: tuple[int, int], matrix: bytes
) -> tuple[bytes, int, int]:
    image, camera = observation.frame.image, observation.frame.camera
    if upright is not None:
        turned = np.frombuffer(matrix).reshape(3, 3) @ np.frombuffer(upright).reshape(3, 3)
        image = cv2.warpPerspective(image, turned @ np.linalg.inv(camera.matrix), size).astype(np.uint8)
    width = min(WIDTH, image.shape[1])
    height = max(1, round(width * image.shape[0] / image.shape[1]))
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    grey = (BRIGHTNESS * cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)).astype(np.uint8)
    done, encoded = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert done, "a picture that was read can be encoded"
    return encoded.tobytes(), width, height
