"""ROS bags whose CameraInfo or compressed images say what is rare, or not so."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.hostile.bags import small_frame
from tests.hostile.inputs import RUN
from tests.hostile.rows import BAD, FINE, Make, Row
from tests.support.bags import BagWriter, write_frames

INFO, IMAGE = "/cam/camera_info", "/cam/image_raw/compressed"
BIG = {"width": 32, "height": 24}
WHOLE = np.array([18.0, 0, 15.5, 0, 18.0, 11.5, 0, 0, 1])
NOISE = np.frombuffer(b"noise" * 99, np.uint8)
CHANGES: dict[str, tuple[int, tuple[str, ...], str, dict[str, Any]]] = {
    "a region of a larger sensor": (FINE, (), INFO, {**BIG, "roi": (4, 4, 16, 12)}),
    "a binned sensor": (FINE, (), INFO, {**BIG, "K": WHOLE, "binning_x": 2, "binning_y": 2}),
    "a region beyond its sensor": (BAD, ("is not within 16x12",), INFO, {"roi": (50_000, 0, 16, 12)}),
    "a region of 4 billion pixels": (BAD, ("roi.width is 4294967295",), INFO, {"roi": (0, 0, 2**32 - 1, 12)}),
    "a region that is not that of the images": (BAD, ("16x12", "8x12"), INFO, {"roi": (0, 0, 8, 12)}),
    "a binning of 4 billion": (BAD, ("binning_x is 4294967295",), INFO, {"binning_x": 2**32 - 1}),
    "a binning to nothing": (BAD, ("give a whole number of pixels",), INFO, {"binning_x": 99}),
    "a camera of zeros": (BAD, ("uncalibrated camera",), INFO, {"width": 0, "height": 0, "K": np.zeros(9)}),
    "a region with a matrix of NaN": (BAD, ("not finite",), INFO, {"roi": (0, 0, 16, 12), "K": np.full(9, np.nan)}),
    "a mosaic that has colours": (FINE, (), IMAGE, {"format": "bayer_rggb8; png compressed "}),
    "a mosaic of noise": (BAD, ("not an image",), IMAGE, {"format": "bayer_rggb8; png compressed ", "data": NOISE}),
    "depths": (BAD, ("has depths",), IMAGE, {"format": "16UC1; compressedDepth png"}),
    "a video": (BAD, ("part of a video (H265)",), IMAGE, {"format": "H265", "data": NOISE}),
    "a format of escapes": (FINE, (), IMAGE, {"format": "\x1b[2J; compressed"}),
}
"""Code, words, topic, and what is changed in its messages."""


class _Changed(BagWriter):
    """Writes the messages of one topic changed."""

    def __init__(self, path: Path, topic: str, change: dict[str, Any]) -> None:
        super().__init__(path, "ros1")
        self._topic, self._change = topic, change

    def write(self, topic: str, message: Any, seconds: float) -> None:
        if topic == self._topic:
            for key, value in self._change.items():
                if key == "roi":
                    x, y, width, height = value
                    value = self.make(
                        "sensor_msgs/msg/RegionOfInterest",
                        x_offset=x,
                        y_offset=y,
                        width=width,
                        height=height,
                        do_rectify=True,
                    )
                setattr(message, key, value)
        super().write(topic, message, seconds)


def changed(topic: str, change: dict[str, Any]) -> Make:
    """Calibrate a frame of a bag in which one topic's messages are changed."""

    def made(root: Path) -> list[str]:
        write_frames(_Changed(root / "drive.bag", topic, change), [small_frame()])
        return ["bag", "drive.bag", *RUN]

    return made


def rows() -> Iterator[Row]:
    """Of a bag of ROS 1."""
    for what, (code, words, topic, change) in CHANGES.items():
        yield Row(f"a bag's messages: {what}", changed(topic, change), code, words or ("Saved",))
